//! Signals, by which a user controls a running simulator from another terminal.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
use signal_hook::iterator::backend::SignalDelivery;
use signal_hook::iterator::exfiltrator::SignalOnly;

/// The action that a signal requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalAction {
    /// SIGHUP: switch the arm off and on.
    PowerCycle,
    /// SIGUSR1, where it is caught: unplug the adapter, or plug it in again.
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
    /// Catches SIGHUP, SIGINT, SIGTERM and SIGUSR2 from now on.
    ///
    /// # Errors
    /// The system refuses.
    pub fn catch() -> io::Result<Self> {
        Self::catch_these(&[SIGHUP, SIGUSR2, SIGINT, SIGTERM])
    }

    /// Likewise, and SIGUSR1 as well.
    ///
    /// # Errors
    /// The system refuses.
    pub fn catch_with_unplug() -> io::Result<Self> {
        Self::catch_these(&[SIGHUP, SIGUSR1, SIGUSR2, SIGINT, SIGTERM])
    }

    fn catch_these(signals: &[i32]) -> io::Result<Self> {
        let (read, write) = UnixStream::pair()?;
        Ok(Self(SignalDelivery::with_pipe(read, write, SignalOnly, signals)?))
    }

    /// The actions since the last call, each at most once. [`SignalAction::End`] is the last.
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
