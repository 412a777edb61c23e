//! The Unix socket for programs of this user.

use std::fs;
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::UnixStream as StdUnixStream;
use std::path::{Path, PathBuf};

use rustix::fs::Mode;
use rustix::process::umask;
use socket2::SockRef;
use tokio::net::{UnixListener, UnixStream};

use super::listener::{AFTER_ERROR, SEND_BUFFER};
use super::start_error::StartError;

/// A Unix socket that only this user can open. Dropping it removes its file, unless another program has replaced it.
#[derive(Debug)]
pub(super) struct LocalSocket {
    listener: UnixListener,
    path: PathBuf,
    inode: u64,
}

impl LocalSocket {
    /// Listens at a path. Replaces a socket that a killed program left.
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
        // The mask applies when the file is created, so other users can never open it.
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
                    let _ = SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER);
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
