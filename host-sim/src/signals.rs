//! Signals as words: what the user asks of a running simulator from another terminal.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::backend::SignalDelivery;
use signal_hook::iterator::exfiltrator::SignalOnly;

/// What a signal asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// SIGHUP: switch the arm off and on.
    PowerCycle,
    /// SIGINT, SIGTERM: end.
    End,
}

/// Signals caught since they were last asked for.
#[derive(Debug)]
pub struct Signals(SignalDelivery<UnixStream, SignalOnly>);

impl Signals {
    /// Catches SIGHUP, SIGINT and SIGTERM from now on.
    ///
    /// # Errors
    /// The system refuses.
    pub fn catch() -> io::Result<Self> {
        let (read, write) = UnixStream::pair()?;
        let delivery = SignalDelivery::with_pipe(read, write, SignalOnly, [SIGHUP, SIGINT, SIGTERM])?;
        Ok(Self(delivery))
    }

    /// What was asked for since the last call, each at most once. A wish to end comes last.
    pub fn wishes(&mut self) -> Vec<Wish> {
        let wish = |signal| if signal == SIGHUP { Wish::PowerCycle } else { Wish::End };
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
