//! A serial port, most often of a USB adapter.
//!
//! The port is opened for this process only, in raw mode, at any baud rate that the adapter supports. If the adapter has a
//! latency timer, the program tries to set it to its minimum.

use std::fs;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, Termios, ioctl_tiocexcl, tcflush, tcgetattr, tcsetattr,
};

/// The shortest setting of the latency timer, in milliseconds.
const SHORTEST_LATENCY_MS: u32 = 1;

/// Why the port cannot be used. Each message says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SerialError {
    /// There is no device at this path.
    #[error("{}: there is no such port: plug the cable in; ports that are there: {}", path.display(), ports())]
    Absent {
        /// The path that [`Serial::open`] got.
        path: PathBuf,
    },
    /// This user has no permission to open it.
    #[error("{}: you may not open it: join the group that owns it (number {group}, most often dialout: sudo usermod -aG dialout $USER) and log in again", path.display())]
    Forbidden {
        /// The path that [`Serial::open`] got.
        path: PathBuf,
        /// The number of the group that owns the port; 0 if it cannot be read.
        group: u32,
    },
    /// Another program has locked the port, or opened it for itself only.
    #[error("{}: another program uses the port: end that one; 'fuser {}' tells its number", .0.display(), .0.display())]
    InUse(PathBuf),
    /// It is not a serial port.
    #[error("{}: that is no serial port: ports that are there: {}", .0.display(), ports())]
    NoPort(PathBuf),
    /// The adapter does not support the baud rate.
    #[error("{}: the adapter refuses {baud} baud ({cause}): choose another baud rate, or an adapter that can", path.display())]
    Baud {
        /// The path that [`Serial::open`] got.
        path: PathBuf,
        /// The baud rate that was asked for, in bits per second.
        baud: u32,
        /// The system's reason.
        cause: io::Error,
    },
    /// The operating system refused for another reason.
    #[error("{}: {cause}: unplug the adapter, plug it in again, and look what 'dmesg' says of it", path.display())]
    Refused {
        /// The path that [`Serial::open`] got.
        path: PathBuf,
        /// The system's reason.
        cause: io::Error,
    },
}

/// An open serial port in raw mode, for this process only.
#[derive(Debug)]
pub struct Serial {
    port: OwnedFd,
    latency: Option<LatencyTimer>,
}

/// The latency timer of the adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatencyTimer {
    /// The setting before the port was opened, in milliseconds.
    pub found: u32,
    /// The setting now, in milliseconds.
    pub now: u32,
}

impl Serial {
    /// Opens a port for this process only, in raw mode, at `baud` bits per second. Discards the bytes that are waiting, and
    /// tries to shorten the latency timer.
    ///
    /// # Errors
    /// See [`SerialError`].
    pub fn open(path: &Path, baud: u32) -> Result<Self, SerialError> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let port = open(path, flags, Mode::empty()).map_err(|cause| refused(path, cause))?;
        let mut mode = tcgetattr(&port).map_err(|_| SerialError::NoPort(path.to_owned()))?;
        flock(&port, FlockOperation::NonBlockingLockExclusive).map_err(|cause| refused(path, cause))?;
        ioctl_tiocexcl(&port).map_err(|cause| refused(path, cause))?;
        set_mode(&port, &mut mode, baud).map_err(|cause| {
            let cause = cause.into();
            SerialError::Baud { path: path.to_owned(), baud, cause }
        })?;
        tcflush(&port, QueueSelector::IOFlush).map_err(|cause| refused(path, cause))?;
        Ok(Self { port, latency: shorten_latency(path) })
    }

    /// The latency timer, if the adapter has one and the kernel shows it.
    #[must_use]
    pub const fn latency(&self) -> Option<LatencyTimer> {
        self.latency
    }

    /// Reads bytes that have arrived. 0 means that no bytes are waiting.
    ///
    /// # Errors
    /// The adapter was unplugged, or the operating system failed.
    pub fn read(&self, bytes: &mut [u8]) -> io::Result<usize> {
        match rustix::io::read(&self.port, bytes) {
            // In raw mode a read without bytes returns EAGAIN, so 0 bytes mean that the adapter is gone.
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            other => Ok(other?),
        }
    }

    /// Sends bytes. Returns how many were accepted.
    ///
    /// # Errors
    /// The adapter was unplugged, or the operating system failed.
    pub fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        match rustix::io::write(&self.port, bytes) {
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            other => Ok(other?),
        }
    }

    /// Waits until all bytes are sent.
    ///
    /// # Errors
    /// The adapter was unplugged, or the operating system failed.
    pub fn drain(&self) -> io::Result<()> {
        Ok(rustix::termios::tcdrain(&self.port)?)
    }
}

impl AsFd for Serial {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.port.as_fd()
    }
}

fn set_mode(port: &OwnedFd, mode: &mut Termios, baud: u32) -> rustix::io::Result<()> {
    mode.make_raw();
    mode.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
    mode.control_modes -= ControlModes::CSTOPB | ControlModes::CRTSCTS;
    mode.set_speed(baud)?;
    tcsetattr(port, OptionalActions::Now, mode)
}

fn refused(path: &Path, cause: Errno) -> SerialError {
    let path = path.to_owned();
    match cause {
        Errno::NOENT | Errno::NODEV | Errno::NXIO => SerialError::Absent { path },
        Errno::ACCESS | Errno::PERM => {
            let group = fs::metadata(&path).map_or(0, |metadata| metadata.gid());
            SerialError::Forbidden { path, group }
        }
        Errno::BUSY | Errno::WOULDBLOCK => SerialError::InUse(path),
        Errno::NOTTY | Errno::ISDIR | Errno::INVAL => SerialError::NoPort(path),
        cause => SerialError::Refused { path, cause: cause.into() },
    }
}

/// The serial ports of USB adapters, for a message.
fn ports() -> String {
    let devices = fs::read_dir("/dev").into_iter().flatten().flatten();
    let mut ports: Vec<String> = devices
        .filter_map(|device| device.file_name().into_string().ok())
        .filter(|name| name.starts_with("ttyUSB") || name.starts_with("ttyACM"))
        .map(|name| format!("/dev/{name}"))
        .collect();
    ports.sort();
    if ports.is_empty() { "none".to_owned() } else { ports.join(" ") }
}

/// Tries to set the latency timer of an FTDI chip (16 ms by default) to its minimum. On most systems only root may write
/// the kernel's file of the timer. `None` if there is no such file.
fn shorten_latency(path: &Path) -> Option<LatencyTimer> {
    let device = fs::canonicalize(path).ok()?;
    let file = Path::new("/sys/bus/usb-serial/devices").join(device.file_name()?).join("latency_timer");
    let read = || fs::read_to_string(&file).ok()?.trim().parse().ok();
    let found = read()?;
    if found > SHORTEST_LATENCY_MS {
        let _ = fs::write(&file, SHORTEST_LATENCY_MS.to_string());
    }
    Some(LatencyTimer { found, now: read().unwrap_or(found) })
}
