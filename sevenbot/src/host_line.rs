//! The line to an arm: bytes with timeouts, and the clock of the line.

use std::fmt;
use std::thread;
use std::time::{Duration, Instant};

use crate::error::PortError;

/// A line to an arm, such as a serial port. A line to an arm in virtual time has a clock of its own.
///
/// All waits for an open arm use this clock, so that an [`Arm`](crate::Arm) in virtual time waits in virtual time.
pub trait HostLine: fmt::Debug + Send {
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

    /// The time on the clock of the line, by default the clock of the system.
    fn now(&self) -> Instant {
        Instant::now()
    }

    /// Waits. Bytes that arrive meanwhile are kept.
    fn sleep(&mut self, duration: Duration) {
        thread::sleep(duration);
    }
}

impl HostLine for Box<dyn HostLine> {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.as_mut().send(bytes)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        self.as_mut().receive(timeout)
    }

    fn now(&self) -> Instant {
        self.as_ref().now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.as_mut().sleep(duration);
    }
}
