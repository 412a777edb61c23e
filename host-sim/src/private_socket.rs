//! A unix socket that only this user can open. Its file is removed at the end.

use std::fs;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

use rustix::fs::Mode;
use rustix::process::umask;

/// Why the socket was not created. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// The path exists and is not a socket.
    #[error("--{option} {}: that is no socket, so it is not replaced: remove it, or choose another path", path.display())]
    Taken {
        /// The option that gave the path, without `--`.
        option: &'static str,
        /// The path of what is no socket.
        path: PathBuf,
    },
    /// Another process listens at the path.
    #[error("--{option} {}: another simulator listens there: end that one, or choose another path", path.display())]
    InUse {
        /// The option that gave the path, without `--`.
        option: &'static str,
        /// The path of the socket in use.
        path: PathBuf,
    },
    /// The operating system refused.
    #[error("--{option} {}: {cause}: choose a short path in a directory that exists and that you can write to", path.display())]
    Refused {
        /// The option that gave the path, without `--`.
        option: &'static str,
        /// The path that the socket was to have.
        path: PathBuf,
        /// The system's reason.
        cause: io::Error,
    },
}

/// A listening socket. Dropping it removes the file, unless another simulator has replaced it.
#[derive(Debug)]
pub struct PrivateSocket {
    listener: UnixListener,
    path: PathBuf,
    inode: u64,
}

impl PrivateSocket {
    /// Listens at `path`, for this user only. Replaces a socket on which no process listens. The errors name `option`.
    ///
    /// # Errors
    /// See [`SocketError`].
    pub fn listen(option: &'static str, path: &Path) -> Result<Self, SocketError> {
        let refused = |cause| SocketError::Refused { option, path: path.to_owned(), cause };
        match fs::symlink_metadata(path) {
            Ok(metadata) if !metadata.file_type().is_socket() => {
                return Err(SocketError::Taken { option, path: path.to_owned() });
            }
            Ok(_) if UnixStream::connect(path).is_ok() => {
                return Err(SocketError::InUse { option, path: path.to_owned() });
            }
            Ok(_) => fs::remove_file(path).map_err(refused)?,
            Err(_) => {}
        }
        // With this mask, other users cannot open the socket, not even right after it was created.
        let mask = umask(Mode::RWXG | Mode::RWXO | Mode::XUSR);
        let listener = UnixListener::bind(path);
        umask(mask);
        let listener = listener.map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let inode = fs::symlink_metadata(path).map_err(refused)?.ino();
        Ok(Self { listener, path: path.to_owned(), inode })
    }

    /// Accepts the next client, as a stream that does not block. `None` if there is none.
    ///
    /// # Errors
    /// The operating system fails.
    pub fn accept(&self) -> io::Result<Option<UnixStream>> {
        match self.listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(true)?;
                Ok(Some(stream))
            }
            Err(error) if is_temporary(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The path that was passed to [`PrivateSocket::listen`].
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl AsFd for PrivateSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.listener.as_fd()
    }
}

impl Drop for PrivateSocket {
    fn drop(&mut self) {
        if fs::symlink_metadata(&self.path).is_ok_and(|metadata| metadata.ino() == self.inode) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Can the operation succeed if it is tried again later?
#[must_use]
pub fn is_temporary(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted | io::ErrorKind::ConnectionAborted
    )
}
