//! Only the seven servos, on a unix socket: for a controller that runs elsewhere (the firmware in an
//! emulator), whose servo bus ends here.
//!
//! One controller at a time; the next one is taken in when it has gone, and meets the servos as they are. A
//! bus has no back-pressure: what the controller does not take is lost.

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
use crate::signals::{Signals, Wish};
use arm_sim::plant::Plant;

/// Why there is no socket. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// Something that is no socket has that name.
    #[error("--servo-socket {}: that is no socket, so it is not replaced: remove it, or choose another path", .0.display())]
    Taken(PathBuf),
    /// Somebody listens there.
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

/// A listening socket; its file goes when this is dropped, if it is still ours.
#[derive(Debug)]
pub struct ServoSocket {
    listener: UnixListener,
    path: PathBuf,
    inode: u64,
}

impl ServoSocket {
    /// Listens at `path`, for this user only, replacing a socket that a dead simulator may have left.
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
        // The mask, as the file must not be open to others for a moment.
        let mask = umask(Mode::RWXG | Mode::RWXO | Mode::XUSR);
        let listener = UnixListener::bind(path);
        umask(mask);
        let listener = listener.map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let inode = fs::symlink_metadata(path).map_err(refused)?.ino();
        Ok(Self { listener, path: path.to_owned(), inode })
    }

    /// Serves one controller after the other until a signal says otherwise.
    ///
    /// # Errors
    /// The operating system fails: poll(2), or accepting a connection.
    pub fn serve(self, mut plant: Plant, clock: &mut Clock, signals: &mut Signals) -> io::Result<()> {
        let mut controller: Option<UnixStream> = None;
        plant.ignore_collisions();
        loop {
            let now = clock.now();
            for wish in signals.wishes() {
                match wish {
                    Wish::End => return Ok(()),
                    Wish::Unplug => {}
                    Wish::PowerCycle => {
                        info!("power cycle");
                        plant.power_cycle(now);
                    }
                    Wish::RestartController => info!("no controller here to restart"),
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
            Err(error) if is_for_later(&error) => Ok(None),
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

/// Everything the controller has sent goes to the servos, and what they have to say back.
///
/// # Errors
/// The controller has gone.
pub fn exchange(stream: &mut UnixStream, plant: &mut Plant, now: Instant) -> io::Result<()> {
    let mut bytes = [0; 4_096];
    match stream.read(&mut bytes) {
        Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
        Ok(count) => plant.bytes(now, bytes.get(..count).unwrap_or(&[])),
        Err(error) if is_for_later(&error) => {}
        Err(error) => return Err(error),
    }
    let answers = plant.poll(now);
    if answers.is_empty() {
        return Ok(());
    }
    match stream.write(&answers) {
        Ok(count) if count == answers.len() => Ok(()),
        Err(error) if !is_for_later(&error) => Err(error),
        _ => {
            debug!("the controller does not read: an answer is lost");
            Ok(())
        }
    }
}

fn is_for_later(error: &io::Error) -> bool {
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
