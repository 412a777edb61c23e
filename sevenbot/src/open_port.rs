//! A serial port: bytes with timeouts, and the reasons why it fails. Knows no frames.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serialport::SerialPort;

use crate::error::{OpenError, PortError};
use crate::host_line::HostLine;
use crate::permission;

/// The shortest timeout that works on every platform.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);
/// After this time a port that takes no bytes has failed.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// A forked process holds a copy of the lock until it executes its program. So a port may stay locked for a short
/// time after its owner closed it.
const UNLOCK_TIMEOUT: Duration = Duration::from_secs(1);
/// Time between two attempts to open a locked port.
const TRY_AGAIN: Duration = Duration::from_millis(20);

/// An open serial port, which no other program can open meanwhile, unless it runs as root.
pub struct OpenPort {
    port: Box<dyn SerialPort>,
}

impl fmt::Debug for OpenPort {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("OpenPort").field("name", &self.port.name()).finish_non_exhaustive()
    }
}

impl OpenPort {
    /// Opens a port and locks it against other programs.
    ///
    /// # Errors
    /// The port cannot be opened.
    pub fn open(name: &str, baud: u32) -> Result<Self, OpenError> {
        let deadline = Instant::now() + UNLOCK_TIMEOUT;
        loop {
            match open_once(name, baud).map_err(|error| open_error(name, &error)) {
                Err(OpenError::Busy) if Instant::now() < deadline => sleep(TRY_AGAIN),
                opened => return opened.map(|port| Self { port }),
            }
        }
    }

    /// Changes the baud rate; `false` if the port does not support it, or failed.
    pub(crate) fn set_baud(&mut self, baud: u32) -> bool {
        self.port.set_baud_rate(baud).is_ok()
    }
}

impl OpenPort {
    /// The number of bytes that a read asks for. On Windows, only as many as have arrived, and at least one. Wine and some
    /// drivers lack the timeout that ends a read after its first bytes, so a read there waits for all bytes that it asks for.
    fn readable_length(&self, longest: usize) -> serialport::Result<usize> {
        if !cfg!(windows) {
            return Ok(longest);
        }
        let waiting = usize::try_from(self.port.bytes_to_read()?).unwrap_or(longest);
        Ok(waiting.clamp(1, longest))
    }
}

impl HostLine for OpenPort {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.port.set_timeout(WRITE_TIMEOUT).map_err(lost)?;
        self.port.write_all(bytes).map_err(|error| match error.kind() {
            ErrorKind::TimedOut => PortError::Stalled,
            kind => PortError::Lost(kind),
        })
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        if timeout.is_zero() && self.port.bytes_to_read().map_err(lost)? == 0 {
            return Ok(Vec::new());
        }
        self.port.set_timeout(timeout.max(SHORTEST_WAIT)).map_err(lost)?;
        let mut chunk = [0; 4096];
        loop {
            let length = self.readable_length(chunk.len()).map_err(lost)?;
            match self.port.read(chunk.get_mut(..length).unwrap_or_default()) {
                Ok(0) => return Err(PortError::Lost(ErrorKind::UnexpectedEof)),
                Ok(length) => return Ok(chunk.into_iter().take(length).collect()),
                Err(error) if error.kind() == ErrorKind::TimedOut => return Ok(Vec::new()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(PortError::Lost(error.kind())),
            }
        }
    }
}

/// The reason why the port at `path` did not open.
fn open_error(path: &str, error: &serialport::Error) -> OpenError {
    match error.kind() {
        serialport::ErrorKind::Io(ErrorKind::NotFound) => OpenError::NotFound,
        serialport::ErrorKind::Io(ErrorKind::PermissionDenied) => {
            OpenError::PermissionDenied { group: permission::group_of(path) }
        }
        // The serialport crate reports a locked port like this. On Windows a missing port is reported like this too.
        serialport::ErrorKind::NoDevice if !cfg!(windows) => OpenError::Busy,
        _ => OpenError::Unusable(error.to_string()),
    }
}

fn open_once(name: &str, baud: u32) -> serialport::Result<Box<dyn SerialPort>> {
    let open = |baud| serialport::new(name, baud).open();
    open(baud).or_else(|error| {
        // On macOS a pseudo-terminal has no baud rate. The serialport crate then needs rate 0.
        if cfg!(target_os = "macos") && error.kind() == serialport::ErrorKind::Unknown {
            open(0)
        } else {
            Err(error)
        }
    })
}

fn lost(error: serialport::Error) -> PortError {
    PortError::Lost(io::Error::from(error).kind())
}
