//! What can go wrong between a computer and servos.

use std::fmt;
use std::time::Duration;

use crate::error::{PortError, ReceiveCounts};

/// Why an exchange with a servo failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoError {
    /// No answer that can be believed, though the servo was asked several times.
    NoAnswer {
        /// The servo.
        id: u8,
        /// How often it was asked.
        attempts: u32,
        /// How long each attempt waited.
        waited: Duration,
        /// What was received instead.
        received: ReceiveCounts,
    },
    /// The servo answers, but the register does not hold what was written.
    NotTaken {
        /// The servo.
        id: u8,
        /// The first register that was written.
        register: u8,
    },
    /// The adapter does not know this baud rate.
    NoSuchRate {
        /// The rate.
        baud: u32,
    },
    /// The port failed.
    Port(PortError),
}

impl From<PortError> for ServoError {
    fn from(error: PortError) -> Self {
        Self::Port(error)
    }
}

impl fmt::Display for ServoError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAnswer { id, attempts, waited, received } => {
                let millis = waited.as_millis();
                write!(out, "servo {id} does not answer ({attempts} tries of {millis} ms): {received}")
            }
            Self::NotTaken { id, register } => {
                write!(out, "servo {id} answers, but its register {register} does not hold what was written")
            }
            Self::NoSuchRate { baud } => write!(out, "this adapter does not know {baud} baud"),
            Self::Port(error) => error.fmt(out),
        }
    }
}

impl std::error::Error for ServoError {}
