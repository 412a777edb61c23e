//! Signals, by which a user controls a running simulator from another terminal.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
use signal_hook::iterator::backend::SignalDelivery;
use signal_hook::iterator::exfiltrator::SignalOnly;
use tracing::warn;

/// The action that a signal requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalAction {
    /// SIGHUP: switch the arm off and on.
    PowerCycle,
    /// SIGUSR1: unplug the simulated adapter, or plug it in again. Ignored without `--servos-only`.
    Unplug,
    /// SIGUSR2: restart the controller, with the servos under power.
    RestartController,
    /// SIGINT, SIGTERM: end.
    End,
}

/// The signals that were caught and not yet returned.
#[derive(Debug)]
pub struct Signals(SignalDelivery<UnixStream, SignalOnly>);

impl Signals {
    /// Catches SIGHUP, SIGINT, SIGTERM, SIGUSR1 and SIGUSR2 from now on.
    ///
    /// # Errors
    /// The system refuses.
    pub fn catch() -> io::Result<Self> {
        let (read, write) = UnixStream::pair()?;
        let signals = [SIGHUP, SIGUSR1, SIGUSR2, SIGINT, SIGTERM];
        Ok(Self(SignalDelivery::with_pipe(read, write, SignalOnly, signals)?))
    }

    /// Logs that [`SignalAction::Unplug`] has no effect here.
    pub fn warn_of_unplug() {
        warn!("SIGUSR1 is ignored: only with --servos-only there is an adapter to unplug");
    }

    /// The actions since the last call, at most one for each signal. [`SignalAction::End`] is the last.
    pub fn actions(&mut self) -> Vec<SignalAction> {
        let action = |signal| match signal {
            SIGHUP => SignalAction::PowerCycle,
            SIGUSR1 => SignalAction::Unplug,
            SIGUSR2 => SignalAction::RestartController,
            _ => SignalAction::End,
        };
        let mut actions: Vec<SignalAction> = self.0.pending().map(action).collect();
        actions.sort_by_key(|&action| action == SignalAction::End);
        actions
    }
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.get_read().as_fd()
    }
}
