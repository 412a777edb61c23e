//! The line between a [`BusMaster`](super::BusMaster) and the servos.

use super::error::ServoError;
use crate::host_line::HostLine;
use crate::open_port::OpenPort;

/// A line to the servos, such as a serial port with a half-duplex adapter behind it.
pub trait ServoLine: HostLine {
    /// Changes the baud rate.
    ///
    /// # Errors
    /// [`ServoError::NoSuchRate`] if the adapter does not support the rate, or its port failed.
    fn set_baud(&mut self, baud: u32) -> Result<(), ServoError>;
}

impl ServoLine for OpenPort {
    fn set_baud(&mut self, baud: u32) -> Result<(), ServoError> {
        if self.set_baud(baud) { Ok(()) } else { Err(ServoError::NoSuchRate { baud }) }
    }
}
