//! The line between a [`BusMaster`](super::BusMaster) and the servos, with its clock.

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
    /// The line failed, or takes no more bytes.
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError>;

    /// The bytes already received, or the first ones within `timeout`. Empty if none arrive.
    ///
    /// # Errors
    /// The line failed.
    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError>;

    /// Changes the baud rate.
    ///
    /// # Errors
    /// [`ServoError::NoSuchRate`] if the adapter does not support the rate.
    fn set_baud(&mut self, baud: u32) -> Result<(), ServoError>;

    /// The time since a fixed instant.
    fn now(&self) -> Duration;
}

/// Pause before each frame: a servo releases the line some microseconds after its last stop bit. A USB adapter pauses
/// longer anyway, but a UART on the bus may not.
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
