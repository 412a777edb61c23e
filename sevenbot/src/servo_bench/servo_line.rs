//! The bytes of the servo bus, and the time: what a [`BusMaster`](super::BusMaster) needs of the world.

use std::thread::sleep;
use std::time::Duration;

use super::error::ServoError;
use crate::error::PortError;
use crate::open_port::OpenPort;

/// A line to the servos, such as a serial port with a half-duplex adapter behind it.
pub trait ServoLine {
    /// Sends bytes.
    ///
    /// # Errors
    /// The line is gone, or takes no more bytes.
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError>;

    /// The bytes that are here, or the first that come within `timeout`. Empty when none came.
    ///
    /// # Errors
    /// The line is gone.
    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError>;

    /// Sends and receives at another baud rate from now on.
    ///
    /// # Errors
    /// [`ServoError::NoSuchRate`] when the adapter does not know the rate.
    fn set_baud(&mut self, baud: u32) -> Result<(), ServoError>;

    /// The time since some instant in the past.
    fn now(&self) -> Duration;
}

/// A servo releases the line some microseconds after its last stop bit, so each frame waits for so long. A USB adapter
/// takes longer anyway; a UART that drives the bus itself may not.
const GUARD_TIME: Duration = Duration::from_micros(100);

impl ServoLine for OpenPort {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        sleep(GUARD_TIME);
        self.send(bytes)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        self.receive(timeout)
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), ServoError> {
        if self.set_baud(baud) { Ok(()) } else { Err(ServoError::NoSuchRate { baud }) }
    }

    fn now(&self) -> Duration {
        self.now()
    }
}
