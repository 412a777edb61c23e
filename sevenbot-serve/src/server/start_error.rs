//! Why the server does not start.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;

#[cfg(target_os = "linux")]
use tty_ports::symlink::SymlinkError;

/// Why the server does not start. Each message but that of [`StartError::System`] says what to do.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The link to a pseudo-terminal cannot be created.
    #[cfg(target_os = "linux")]
    #[error("--pty {0}")]
    Symlink(#[from] SymlinkError),
    /// The system gives no pseudo-terminal, for example because too many files are open.
    #[cfg(target_os = "linux")]
    #[error("no pseudo-terminal: {0}: is /dev/pts mounted, and does 'ulimit -n' allow more files?")]
    Pty(io::Error),
    /// Pseudo-terminals are for Linux.
    #[cfg(not(target_os = "linux"))]
    #[error(
        "--pty needs Linux: use --tcp PORT here, and socket://127.0.0.1:PORT in programs that use pyserial"
    )]
    NoPty,
    /// Another program listens there.
    #[error(
        "{0}: another program listens there: choose another port, or end it; on Linux, 'ss -ltnp' shows which one"
    )]
    InUse(SocketAddr),
    /// The local socket cannot be used.
    #[error("{}: {cause}: choose another path for the socket", path.display())]
    Socket {
        /// The path at which the server was to listen.
        path: PathBuf,
        /// Why the socket cannot be there, in words of the system or of the server.
        cause: io::Error,
    },
    /// The certificate or its key cannot be used.
    #[error(
        "{option} {}: {cause}: use a certificate (BEGIN CERTIFICATE) and its private key (BEGIN PRIVATE KEY) in PEM; \
         docs/serve.md shows how to make them",
        path.display()
    )]
    Certificate {
        /// The option with the name of the file.
        option: &'static str,
        /// The certificate or the key.
        path: PathBuf,
        /// Why the file cannot be read, or why TLS does not accept it.
        cause: io::Error,
    },
    /// The operating system refuses a resource that every server needs.
    #[error("the operating system refuses: {0}")]
    System(io::Error),
    /// The server cannot listen there, for another reason than [`StartError::InUse`].
    #[error("{address}: {cause}: choose an address of this computer")]
    Address {
        /// The address and port at which the server was to listen.
        address: SocketAddr,
        /// The system's reason.
        cause: io::Error,
    },
}
