//! Why the server does not start.

use std::io;
use std::net::SocketAddr;

use tty_ports::symlink::SymlinkError;

/// Why the server does not start. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A link cannot be created.
    #[error("--pty {0}")]
    Symlink(#[from] SymlinkError),
    /// The system has no pseudo-terminal.
    #[error("no pseudo-terminal: {0}: see that /dev/pts is mounted and has not run out, nor 'ulimit -n'")]
    Pty(io::Error),
    /// Another program listens there.
    #[error("{0}: another program listens there: choose another port, or end it; 'ss -ltnp' shows which one")]
    InUse(SocketAddr),
    /// The address cannot be used.
    #[error("{address}: {cause}: choose an address of this computer")]
    Address {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        cause: io::Error,
    },
}
