//! Simulated servos on a unix socket, for a controller in another process, such as the firmware in an emulator.
//!
//! One controller can be connected at a time. The servos keep their state when the next controller connects. A servo bus has
//! no flow control: bytes that the controller does not read are lost.

use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::path::Path;

use protocol_core::time::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use tracing::{debug, info};

use crate::angle_log::AngleLog;
use crate::clock::{RealClock, sleep_until};
use crate::private_socket::{PrivateSocket, SocketError, is_temporary};
use crate::signals::{SignalAction, Signals};
use arm_sim::plant::Plant;

/// A listening socket for one controller at a time, and the optional log of the true angles.
#[derive(Debug)]
pub struct ServoSocket {
    socket: PrivateSocket,
    angles: Option<AngleLog>,
}

impl ServoSocket {
    /// Listens at `path`, for this user only. The true angles are written to `angles`.
    ///
    /// # Errors
    /// See [`SocketError`].
    pub fn listen(path: &Path, angles: Option<AngleLog>) -> Result<Self, SocketError> {
        let socket = PrivateSocket::listen("servo-socket", path)?;
        Ok(Self { socket, angles })
    }

    /// Serves one controller after another until a signal ends it.
    ///
    /// # Errors
    /// The operating system fails: poll(2), accepting a connection, or writing the angles.
    pub fn serve(mut self, mut plant: Plant, clock: &mut RealClock, signals: &mut Signals) -> io::Result<()> {
        let mut controller: Option<UnixStream> = None;
        plant.ignore_collisions();
        loop {
            let now = clock.now();
            for action in signals.actions() {
                match action {
                    SignalAction::End => return Ok(()),
                    SignalAction::Unplug => Signals::warn_of_unplug(),
                    SignalAction::PowerCycle => {
                        info!("power cycle");
                        plant.power_cycle(now);
                    }
                    SignalAction::RestartController => info!("no controller here to restart"),
                }
            }
            if controller.is_none() {
                // The servos move on, and nobody hears their answers.
                plant.poll(now);
                controller = self.socket.accept()?;
                controller.iter().for_each(|_| info!("controller connected"));
            }
            if let Some(stream) = &mut controller
                && let Err(end) = exchange(stream, &mut plant, now)
            {
                info!("controller gone ({end})");
                controller = None;
                continue;
            }
            let mut deadline = plant.deadline().unwrap_or(Instant::FAR_FUTURE);
            if let Some(angles) = &mut self.angles {
                angles.write(now, &plant)?;
                deadline = deadline.min(angles.due());
            }
            let source = controller.as_ref().map_or_else(|| self.socket.as_fd(), AsFd::as_fd);
            sleep(&sleep_until(clock.now(), deadline), source, signals)?;
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
    match stream.write(answers) {
        Ok(count) if count == answers.len() => Ok(()),
        Err(error) if !is_temporary(&error) => Err(error),
        _ => {
            debug!("the controller does not read: an answer is lost");
            Ok(())
        }
    }
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
