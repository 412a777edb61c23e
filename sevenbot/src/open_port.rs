//! A serial port: bytes with timeouts, and why it fails. Knows no frame.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serialport::SerialPort;

use crate::error::{OpenError, PortError};

/// The shortest timeout that every platform takes for what it is.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);
/// How long the port may refuse to take more bytes.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// A lock may outlive its owner: a process that was started meanwhile holds it too until it has become another
/// program, and on a busy machine that takes a while.
const UNLOCK_TIMEOUT: Duration = Duration::from_secs(1);
/// How long to wait before a locked port is tried again.
const TRY_AGAIN: Duration = Duration::from_millis(20);

/// An open serial port.
pub struct OpenPort {
    port: Box<dyn SerialPort>,
    opened: Instant,
}

impl fmt::Debug for OpenPort {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("OpenPort").field("name", &self.port.name()).finish_non_exhaustive()
    }
}

impl OpenPort {
    /// Opens a port, whatever is behind it. No other program can open it meanwhile.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn open(name: &str, baud: u32) -> Result<Self, OpenError> {
        let deadline = Instant::now() + UNLOCK_TIMEOUT;
        loop {
            match open_once(name, baud).map_err(|error| OpenError::of(name, error)) {
                Err(OpenError::Busy) if Instant::now() < deadline => sleep(TRY_AGAIN),
                opened => return opened.map(|port| Self { port, opened: Instant::now() }),
            }
        }
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// The port is gone, or takes no more bytes.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.port.set_timeout(WRITE_TIMEOUT).map_err(lost)?;
        self.port.write_all(bytes).map_err(|error| match error.kind() {
            ErrorKind::TimedOut => PortError::Stalled,
            kind => PortError::Lost(kind),
        })
    }

    /// The bytes that are here, or the first that come within `timeout`. Empty when none came.
    ///
    /// # Errors
    /// The port is gone.
    pub fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        if timeout.is_zero() && self.port.bytes_to_read().map_err(lost)? == 0 {
            return Ok(Vec::new());
        }
        self.port.set_timeout(timeout.max(SHORTEST_WAIT)).map_err(lost)?;
        let mut chunk = [0; 4096];
        loop {
            match self.port.read(&mut chunk) {
                Ok(0) => return Err(PortError::Lost(ErrorKind::UnexpectedEof)),
                Ok(length) => return Ok(chunk.into_iter().take(length).collect()),
                Err(error) if error.kind() == ErrorKind::TimedOut => return Ok(Vec::new()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(PortError::Lost(error.kind())),
            }
        }
    }

    /// Sends and receives at another baud rate from now on; `false` where the port does not know the rate.
    pub(crate) fn set_baud(&mut self, baud: u32) -> bool {
        self.port.set_baud_rate(baud).is_ok()
    }

    /// The time since it was opened.
    pub(crate) fn now(&self) -> Duration {
        self.opened.elapsed()
    }
}

fn open_once(name: &str, baud: u32) -> serialport::Result<Box<dyn SerialPort>> {
    let open = |baud| serialport::new(name, baud).open();
    open(baud).or_else(|error| {
        // A pseudo-terminal on macOS takes no baud rate; the serialport crate asks for 0 there.
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
