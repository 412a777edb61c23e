//! Tells when a file descriptor that tokio does not know can be read or written.

use std::io;
use std::os::fd::{AsFd, OwnedFd};

use tokio::io::unix::{AsyncFd, AsyncFdReadyGuard};

#[derive(Debug)]
pub(super) struct Readiness(AsyncFd<OwnedFd>);

impl Readiness {
    /// Watches a duplicate of the descriptor of `file`, which has to be non-blocking.
    pub(super) fn of(file: &impl AsFd) -> io::Result<Self> {
        let handle = file.as_fd().try_clone_to_owned()?;
        // The newer way to register is unsafe for types that may close their descriptor or change it; this one does not.
        #[expect(deprecated, reason = "an OwnedFd stays open, and stays the same")]
        AsyncFd::new(handle).map(Self)
    }

    /// Ends when there is something to read, or an error. The readiness is cleared before the file is read, so bytes that
    /// arrive meanwhile set it again.
    pub(super) async fn readable(&self) -> io::Result<()> {
        self.0.readable().await.map(clear)
    }

    /// Ends when the file takes bytes.
    pub(super) async fn writable(&self) -> io::Result<()> {
        self.0.writable().await.map(clear)
    }
}

fn clear(mut ready: AsyncFdReadyGuard<'_, OwnedFd>) {
    ready.clear_ready();
}
