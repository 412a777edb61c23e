//! A TCP port that clients connect to.

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};

use rustix::net::sockopt::set_socket_send_buffer_size;

use super::start_error::StartError;

/// Bytes that the kernel keeps for a client that does not read; the kernel doubles it. Its default of megabytes would
/// hand old reports to a slow client.
pub(crate) const SEND_BUFFER: usize = 4_096;

/// A TCP port that clients connect to.
#[derive(Debug)]
pub(crate) struct Listener {
    listener: TcpListener,
    address: SocketAddr,
}

impl Listener {
    pub(crate) fn open(address: SocketAddr) -> Result<Self, StartError> {
        let failed = |cause: io::Error| match cause.kind() {
            io::ErrorKind::AddrInUse => StartError::InUse(address),
            _ => StartError::Address { address, cause },
        };
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self { listener, address })
    }

    pub(crate) const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The next client that has connected. It neither blocks nor delays short frames.
    pub(crate) fn accept(&self) -> Option<TcpStream> {
        let (stream, _) = self.listener.accept().ok()?;
        stream.set_nonblocking(true).ok()?;
        stream.set_nodelay(true).ok()?;
        set_socket_send_buffer_size(&stream, SEND_BUFFER).ok()?;
        Some(stream)
    }
}

impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.listener.as_fd()
    }
}
