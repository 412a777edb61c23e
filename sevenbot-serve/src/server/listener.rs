//! TCP ports and Unix sockets that clients connect to.

use std::fs;
use std::io;
use std::net::SocketAddr;
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::UnixStream as StdUnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::Mode;
use rustix::net::sockopt;
use rustix::process::umask;
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};

use super::start_error::StartError;

/// Bytes that the kernel keeps for a client that does not read; the kernel doubles it. Its default of megabytes would
/// hand old reports to a slow client.
pub(super) const SEND_BUFFER: usize = 4_096;
/// Bytes that the kernel keeps of a client whose bytes have to wait; the kernel doubles it.
const RECEIVE_BUFFER: usize = 4_096;
/// A peer that is silent for this long is asked whether it is still there.
const KEEPALIVE_IDLE: Duration = Duration::from_secs(10);
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(5);
const KEEPALIVE_PROBES: u32 = 3;
/// A peer that takes no byte for this long, in milliseconds, is gone.
const USER_TIMEOUT: u32 = 60_000;
/// After an error, such as too many open files, the next connection is waited for.
const AFTER_ERROR: Duration = Duration::from_millis(100);

/// Opens a TCP port.
pub(super) fn open_tcp(address: SocketAddr) -> Result<TcpListener, StartError> {
    let failed = |cause: io::Error| match cause.kind() {
        io::ErrorKind::AddrInUse => StartError::InUse(address),
        _ => StartError::Address { address, cause },
    };
    let listener = std::net::TcpListener::bind(address).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let _ = sockopt::set_socket_recv_buffer_size(&listener, RECEIVE_BUFFER);
    TcpListener::from_std(listener).map_err(failed)
}

/// The next client. It does not delay short frames, and is dropped when its computer is gone.
pub(super) async fn accept_tcp(listener: &TcpListener) -> (TcpStream, SocketAddr) {
    loop {
        match listener.accept().await {
            Ok((stream, peer)) if set_options(&stream).is_ok() => return (stream, peer),
            Ok(_) => {}
            Err(_) => tokio::time::sleep(AFTER_ERROR).await,
        }
    }
}

fn set_options(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let stream = stream.as_fd();
    sockopt::set_socket_send_buffer_size(stream, SEND_BUFFER)?;
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, KEEPALIVE_IDLE)?;
    sockopt::set_tcp_keepintvl(stream, KEEPALIVE_INTERVAL)?;
    sockopt::set_tcp_keepcnt(stream, KEEPALIVE_PROBES)?;
    Ok(sockopt::set_tcp_user_timeout(stream, USER_TIMEOUT)?)
}

/// A Unix socket that only this user can open. Dropping it removes its file, unless another program has replaced it.
#[derive(Debug)]
pub(super) struct LocalSocket {
    listener: UnixListener,
    path: PathBuf,
    inode: u64,
}

impl LocalSocket {
    /// Listens at a path. Replaces a socket that a program left which was killed.
    pub(super) fn open(path: &Path) -> Result<Self, StartError> {
        let failed = |cause| StartError::Socket { path: path.to_owned(), cause };
        match fs::symlink_metadata(path) {
            Ok(found) if !found.file_type().is_socket() => {
                return Err(failed(io::Error::other("that is no socket, so it is not replaced")));
            }
            Ok(_) if StdUnixStream::connect(path).is_ok() => {
                return Err(failed(io::Error::other("another server listens there")));
            }
            Ok(_) => fs::remove_file(path).map_err(failed)?,
            Err(_) => {}
        }
        // With this mask, other users cannot open the file at any time.
        let mask = umask(Mode::RWXG | Mode::RWXO | Mode::XUSR);
        let listener = UnixListener::bind(path);
        umask(mask);
        let listener = listener.map_err(failed)?;
        let inode = fs::symlink_metadata(path).map_err(failed)?.ino();
        Ok(Self { listener, path: path.to_owned(), inode })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) async fn accept(&self) -> UnixStream {
        loop {
            match self.listener.accept().await {
                Ok((stream, _)) => {
                    let _ = sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER);
                    return stream;
                }
                Err(_) => tokio::time::sleep(AFTER_ERROR).await,
            }
        }
    }
}

impl Drop for LocalSocket {
    fn drop(&mut self) {
        if fs::symlink_metadata(&self.path).is_ok_and(|found| found.ino() == self.inode) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    #[test]
    fn a_peer_whose_computer_is_gone_is_noticed() {
        tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(async {
            let listener = open_tcp(SocketAddr::from(([127, 0, 0, 1], 0))).unwrap();
            let _client = std::net::TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let (stream, _) = accept_tcp(&listener).await;
            assert!(sockopt::socket_keepalive(&stream).unwrap());
            let silence = sockopt::tcp_keepidle(&stream).unwrap()
                + sockopt::tcp_keepintvl(&stream).unwrap() * sockopt::tcp_keepcnt(&stream).unwrap();
            assert_eq!(silence, Duration::from_secs(25), "the time in docs/serve.md");
            assert_eq!(sockopt::tcp_user_timeout(&stream).unwrap(), 60_000);
            assert!(stream.nodelay().unwrap());
        });
    }
}
