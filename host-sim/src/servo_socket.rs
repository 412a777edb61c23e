//! Simulated servos on a unix socket, for a controller in another process: the firmware in an emulator.
//!
//! One controller can be connected at a time. The servos keep their state from one controller to the next. A bus has no
//! flow control: bytes that the controller does not read are lost.

use std::fs;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

use protocol_core::time::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::Mode;
use rustix::io::Errno;
use rustix::process::umask;
use tracing::{debug, info};

use crate::clock::{Clock, sleep_until};
use crate::signals::{SignalAction, Signals};
use arm_sim::plant::Plant;

/// Why the socket was not created. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// The path exists and is not a socket.
    #[error("--servo-socket {}: that is no socket, so it is not replaced: remove it, or choose another path", .0.display())]
    Taken(PathBuf),
    /// Another process listens there.
    #[error("--servo-socket {}: another simulator listens there: end that one, or choose another path", .0.display())]
    InUse(PathBuf),
    /// The operating system refused.
    #[error("--servo-socket {}: {cause}: choose a short path in a directory that exists and that you can write to", path.display())]
    Refused {
        /// The path.
        path: PathBuf,
        /// The system's reason.
        cause: io::Error,
    },
}

/// A listening socket. Dropping it removes the file, unless another simulator has replaced it.
#[derive(Debug)]
pub struct ServoSocket {
    listener: UnixListener,
    path: PathBuf,
    inode: u64,
}

impl ServoSocket {
    /// Listens at `path`, for this user only. Replaces a socket that an earlier simulator may have left.
    ///
    /// # Errors
    /// See [`SocketError`].
    pub fn listen(path: &Path) -> Result<Self, SocketError> {
        let refused = |cause| SocketError::Refused { path: path.to_owned(), cause };
        match fs::symlink_metadata(path) {
            Ok(metadata) if !metadata.file_type().is_socket() => {
                return Err(SocketError::Taken(path.to_owned()));
            }
            Ok(_) if UnixStream::connect(path).is_ok() => return Err(SocketError::InUse(path.to_owned())),
            Ok(_) => fs::remove_file(path).map_err(refused)?,
            Err(_) => {}
        }
        // With this mask, other users cannot open the file at any time.
        let mask = umask(Mode::RWXG | Mode::RWXO | Mode::XUSR);
        let listener = UnixListener::bind(path);
        umask(mask);
        let listener = listener.map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let inode = fs::symlink_metadata(path).map_err(refused)?.ino();
        Ok(Self { listener, path: path.to_owned(), inode })
    }

    /// Serves one controller after another until a signal ends it.
    ///
    /// # Errors
    /// The operating system fails: poll(2), or accepting a connection.
    pub fn serve(self, mut plant: Plant, clock: &mut Clock, signals: &mut Signals) -> io::Result<()> {
        let mut controller: Option<UnixStream> = None;
        plant.ignore_collisions();
        loop {
            let now = clock.now();
            for action in signals.actions() {
                match action {
                    SignalAction::End => return Ok(()),
                    SignalAction::Unplug => {}
                    SignalAction::PowerCycle => {
                        info!("power cycle");
                        plant.power_cycle(now);
                    }
                    SignalAction::RestartController => info!("no controller here to restart"),
                }
            }
            if controller.is_none() {
                controller = self.accept()?;
            }
            if let Some(stream) = &mut controller
                && let Err(end) = exchange(stream, &mut plant, now)
            {
                info!("controller gone ({end})");
                controller = None;
                continue;
            }
            let deadline = plant.deadline().unwrap_or(Instant::FAR_FUTURE);
            let source = controller.as_ref().map_or_else(|| self.listener.as_fd(), AsFd::as_fd);
            sleep(&sleep_until(clock.now(), deadline), source, signals)?;
        }
    }

    fn accept(&self) -> io::Result<Option<UnixStream>> {
        match self.listener.accept() {
            Ok((stream, _)) => {
                info!("controller connected");
                stream.set_nonblocking(true)?;
                Ok(Some(stream))
            }
            Err(error) if is_temporary(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

impl Drop for ServoSocket {
    fn drop(&mut self) {
        if fs::symlink_metadata(&self.path).is_ok_and(|metadata| metadata.ino() == self.inode) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Passes the bytes of the controller to the servos, and their answers back.
///
/// # Errors
/// The controller has disconnected.
pub fn exchange(stream: &mut UnixStream, plant: &mut Plant, now: Instant) -> io::Result<()> {
    let mut bytes = [0; 4_096];
    match stream.read(&mut bytes) {
        Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
        Ok(count) => plant.bytes(now, bytes.get(..count).unwrap_or(&[])),
        Err(error) if is_temporary(&error) => {}
        Err(error) => return Err(error),
    }
    let answers = plant.poll(now);
    if answers.is_empty() {
        return Ok(());
    }
    match stream.write(&answers) {
        Ok(count) if count == answers.len() => Ok(()),
        Err(error) if !is_temporary(&error) => Err(error),
        _ => {
            debug!("the controller does not read: an answer is lost");
            Ok(())
        }
    }
}

fn is_temporary(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted | io::ErrorKind::ConnectionAborted
    )
}

fn sleep(time: &Timespec, source: BorrowedFd<'_>, signals: &Signals) -> io::Result<()> {
    let signals = signals.as_fd();
    let mut wanted =
        [PollFd::from_borrowed_fd(source, PollFlags::IN), PollFd::from_borrowed_fd(signals, PollFlags::IN)];
    match poll(&mut wanted, Some(time)) {
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}
