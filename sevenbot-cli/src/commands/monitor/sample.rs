//! The arm at one moment: two reads, and how long the first one took.
//!
//! Knows what to read, not how it is shown.

use std::time::{Duration, Instant};

use sevenbot::map::{MOTOR_STATE, PRESENT_POSITION, SPEED, TARGET_POSITION};
use sevenbot::{Arm, Error, Joint, Snapshot, Span, Speed, StatusBlock};

/// Everything that is shown of an arm.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// Since the monitor began.
    pub(crate) time: Duration,
    /// From the motor state to the present positions.
    pub(crate) registers: Snapshot,
    /// Firmware without a status block has none.
    pub(crate) status: Option<StatusBlock>,
    /// From a question to its answer.
    pub(crate) round_trip: Duration,
}

impl Sample {
    /// Takes one from an arm.
    pub(crate) fn take(arm: &mut Arm, start: Instant) -> Result<Self, Error> {
        let asked = Instant::now();
        let registers = arm.read_span(Span::between(&MOTOR_STATE, &PRESENT_POSITION))?;
        let round_trip = asked.elapsed();
        Ok(Self { time: start.elapsed(), registers, status: arm.status()?, round_trip })
    }

    /// Where the joint should be, in degrees.
    pub(crate) fn target(&self, joint: Joint) -> u8 {
        self.registers.at(TARGET_POSITION.of(joint))
    }

    /// Where the joint is, in degrees.
    pub(crate) fn present(&self, joint: Joint) -> u8 {
        self.registers.at(PRESENT_POSITION.of(joint))
    }

    /// How fast the joint moves when it does.
    pub(crate) fn speed(&self, joint: Joint) -> Speed {
        Speed::from_steps(self.registers.at(SPEED.of(joint))).unwrap_or(Speed::MAXIMUM)
    }

    /// Register 29.
    pub(crate) fn motor_state(&self) -> u8 {
        self.registers.byte(&MOTOR_STATE)
    }

    /// Is the joint on its way? Without a status block nobody knows.
    pub(crate) fn is_moving(&self, joint: Joint) -> bool {
        self.status.as_ref().is_some_and(|status| status.is_moving(joint))
    }

    /// Does the joint's servo not answer?
    pub(crate) fn is_missing(&self, joint: Joint) -> bool {
        self.status.as_ref().is_some_and(|status| status.is_missing(joint))
    }
}
