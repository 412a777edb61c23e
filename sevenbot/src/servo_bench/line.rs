//! The bytes of the servo bus, and the time: what a [`ServoBus`](super::ServoBus) needs of the world.

use std::io::{ErrorKind, Read, Write};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serialport::SerialPort;

use super::error::Error;

/// The shortest timeout that every platform takes for what it is.
const SHORTEST_WAIT: Duration = Duration::from_millis(1);
/// How long the port may refuse to take more bytes.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);

/// A line to the servos, such as a serial port with a half-duplex adapter behind it.
pub trait Line {
    /// Sends bytes.
    ///
    /// # Errors
    /// The line is gone, or takes no more bytes.
    fn send(&mut self, bytes: &[u8]) -> Result<(), Error>;

    /// The bytes that are here, or the first that come within `patience`. Empty when none came.
    ///
    /// # Errors
    /// The line is gone.
    fn receive(&mut self, patience: Duration) -> Result<Vec<u8>, Error>;

    /// Sends and receives at another baud rate from now on.
    ///
    /// # Errors
    /// [`Error::NoSuchRate`] when the adapter does not know the rate.
    fn set_baud(&mut self, baud: u32) -> Result<(), Error>;

    /// The time since some instant in the past.
    fn now(&self) -> Duration;
}

/// A servo releases the line some microseconds after its last stop bit, so each frame waits for so long. A USB adapter
/// takes longer anyway; a UART that drives the bus itself may not.
const GUARD_TIME: Duration = Duration::from_micros(100);

/// A serial port.
pub(crate) struct SerialLine {
    port: Box<dyn SerialPort>,
    start: Instant,
}

impl SerialLine {
    pub(crate) fn new(port: Box<dyn SerialPort>) -> Self {
        Self { port, start: Instant::now() }
    }
}

impl Line for SerialLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), Error> {
        sleep(GUARD_TIME);
        self.port.set_timeout(WRITE_TIMEOUT).map_err(lost)?;
        self.port.write_all(bytes).map_err(|error| match error.kind() {
            ErrorKind::TimedOut => Error::Stalled,
            kind => Error::PortLost(kind),
        })
    }

    fn receive(&mut self, patience: Duration) -> Result<Vec<u8>, Error> {
        let mut chunk = [0; 1024];
        if patience.is_zero() && self.port.bytes_to_read().map_err(lost)? == 0 {
            return Ok(Vec::new());
        }
        self.port.set_timeout(patience.max(SHORTEST_WAIT)).map_err(lost)?;
        match self.port.read(&mut chunk) {
            Ok(0) => Err(Error::PortLost(ErrorKind::UnexpectedEof)),
            Ok(length) => Ok(chunk.into_iter().take(length).collect()),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                Ok(Vec::new())
            }
            Err(error) => Err(Error::PortLost(error.kind())),
        }
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), Error> {
        self.port.set_baud_rate(baud).map_err(|_| Error::NoSuchRate { baud })
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }
}

fn lost(error: serialport::Error) -> Error {
    Error::PortLost(std::io::Error::from(error).kind())
}
