//! Failures of an exchange with a servo.

use std::fmt;
use std::time::Duration;

use crate::error::{PortError, ReceiveCounts};

/// Why an exchange with a servo failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoError {
    /// No attempt brought an accepted answer.
    NoAnswer {
        /// The id of the servo.
        id: u8,
        /// The number of attempts.
        attempts: u32,
        /// The timeout of each attempt.
        waited: Duration,
        /// What was received instead.
        received: ReceiveCounts,
    },
    /// The servo answers, but its register does not hold the written value.
    NotTaken {
        /// The id of the servo.
        id: u8,
        /// The first register that was written.
        register: u8,
    },
    /// The adapter does not support this baud rate.
    NoSuchRate {
        /// The rate in bits per second.
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
            Self::NoSuchRate { baud } => write!(out, "this adapter does not support {baud} baud"),
            Self::Port(error) => error.fmt(out),
        }
    }
}

impl std::error::Error for ServoError {}
