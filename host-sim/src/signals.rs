//! Signals as words: what the user asks of a running simulator from another terminal.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
use signal_hook::iterator::backend::SignalDelivery;
use signal_hook::iterator::exfiltrator::SignalOnly;

/// What a signal asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// SIGHUP: switch the arm off and on.
    PowerCycle,
    /// SIGUSR1, where it is caught: pull the adapter out, or plug it in again.
    Unplug,
    /// SIGUSR2: restart the controller, with the servos under power.
    RestartController,
    /// SIGINT, SIGTERM: end.
    End,
}

/// Signals caught since they were last asked for.
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

    /// What was asked for since the last call, each at most once. A wish to end comes last.
    pub fn wishes(&mut self) -> Vec<Wish> {
        let wish = |signal| match signal {
            SIGHUP => Wish::PowerCycle,
            SIGUSR1 => Wish::Unplug,
            SIGUSR2 => Wish::RestartController,
            _ => Wish::End,
        };
        let mut wishes: Vec<Wish> = self.0.pending().map(wish).collect();
        wishes.sort_by_key(|&wish| wish == Wish::End);
        wishes
    }
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.get_read().as_fd()
    }
}
