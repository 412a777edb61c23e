//! Stand-ins for what a system does not support. They cannot be opened, so these types have no values.

use std::io;
use std::path::Path;
use std::sync::Arc;

use super::shared::SharedHub;
use super::start_error::StartError;

#[derive(Debug)]
#[cfg(not(target_os = "linux"))]
pub(super) enum PtyPort {}

#[cfg(not(target_os = "linux"))]
impl PtyPort {
    pub(super) const fn open(_link: &Path) -> Result<Self, StartError> {
        Err(StartError::NoPty)
    }

    pub(super) async fn serve(self, _shared: Arc<SharedHub>) -> io::Result<()> {
        match self {}
    }
}

#[derive(Debug)]
#[cfg(not(unix))]
pub(super) enum LocalSocket {}

#[cfg(not(unix))]
impl LocalSocket {
    pub(super) fn open(path: &Path) -> Result<Self, StartError> {
        let cause = io::Error::other("this system has no Unix sockets");
        Err(StartError::Socket { path: path.to_owned(), cause })
    }

    pub(super) const fn path(&self) -> &Path {
        match *self {}
    }

    pub(super) async fn accept(&self) -> tokio::net::TcpStream {
        match *self {}
    }
}
