//! Failures of an exchange with a servo.

use std::time::Duration;

use crate::error::{PortError, ReceiveCounts};

/// Why an exchange with a servo failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ServoError {
    /// No attempt brought an accepted answer.
    #[error("servo {id} does not answer ({attempts} tries of {} ms): {received}", waited.as_millis())]
    NoAnswer {
        /// The id that was asked.
        id: u8,
        /// The number of attempts, at least 1.
        attempts: u32,
        /// The timeout of each attempt.
        waited: Duration,
        /// What was received instead, in all attempts together.
        received: ReceiveCounts,
    },
    /// The servo answers, but its register does not hold the written value.
    #[error("servo {id} answers, but its register {register} does not hold what was written")]
    NotTaken {
        /// The id of the servo that answers.
        id: u8,
        /// The first register that was written.
        register: u8,
    },
    /// The adapter does not support this baud rate.
    #[error("this adapter does not support {baud} baud")]
    NoSuchRate {
        /// The rate in bits per second.
        baud: u32,
    },
    /// The port of the adapter takes no more bytes, or is gone.
    #[error(transparent)]
    Port(#[from] PortError),
}
