//! Tells when a connection breaks, even while nothing is read from it.

#[cfg(unix)]
use std::io;
#[cfg(unix)]
use std::os::fd::{AsFd, OwnedFd};

#[cfg(unix)]
use tokio::io::Interest;
#[cfg(unix)]
use tokio::io::unix::AsyncFd;

#[cfg(unix)]
#[derive(Debug)]
pub(super) struct Breakage(AsyncFd<OwnedFd>);

#[cfg(unix)]
impl Breakage {
    /// Watches a duplicate of the socket's descriptor.
    pub(super) fn of(socket: &impl AsFd) -> io::Result<Self> {
        let handle = socket.as_fd().try_clone_to_owned()?;
        #[expect(deprecated, reason = "an OwnedFd stays open, and stays the same")]
        AsyncFd::with_interest(handle, Interest::ERROR).map(Self)
    }

    /// Runs `work` until it ends; `None` if the connection breaks first.
    pub(super) async fn or_end<T>(&self, work: impl Future<Output = T>) -> Option<T> {
        tokio::select! {
            outcome = work => Some(outcome),
            _ = self.0.ready(Interest::ERROR) => None,
        }
    }
}

/// Where the system does not tell, a broken connection is noticed when it is used.
#[cfg(not(unix))]
#[derive(Debug)]
pub(super) struct Breakage;

#[cfg(not(unix))]
impl Breakage {
    #[expect(clippy::unnecessary_wraps, reason = "as on Unix")]
    pub(super) const fn of<S>(_socket: &S) -> std::io::Result<Self> {
        Ok(Self)
    }

    pub(super) async fn or_end<T>(&self, work: impl Future<Output = T>) -> Option<T> {
        Some(work.await)
    }
}
