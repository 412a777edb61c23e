//! A sample of the arm: two reads, and the round-trip time of the first.

use std::time::{Duration, Instant};

use sevenbot::map::{MOTOR_STATE, PRESENT_POSITION, SPEED, TARGET_POSITION};
use sevenbot::{Arm, Error, Joint, Snapshot, Span, Speed, StatusBlock};

/// The state of an arm at one time.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// Since the start of the monitor.
    pub(crate) time: Duration,
    /// From the motor state to the present positions.
    pub(crate) registers: Snapshot,
    /// `None` if the firmware has no status block.
    pub(crate) status: Option<StatusBlock>,
    /// From a request to its reply.
    pub(crate) round_trip: Duration,
}

impl Sample {
    /// Reads a sample from the arm.
    pub(crate) fn take(arm: &mut Arm, start: Instant) -> Result<Self, Error> {
        let asked = Instant::now();
        let registers = arm.read_span(Span::between(&MOTOR_STATE, &PRESENT_POSITION))?;
        let round_trip = asked.elapsed();
        Ok(Self { time: start.elapsed(), registers, status: arm.status()?, round_trip })
    }

    /// The target position in degrees.
    pub(crate) fn target(&self, joint: Joint) -> u8 {
        self.registers.at(TARGET_POSITION.of(joint))
    }

    /// The present position in degrees.
    pub(crate) fn present(&self, joint: Joint) -> u8 {
        self.registers.at(PRESENT_POSITION.of(joint))
    }

    /// The speed of the joint's moves.
    pub(crate) fn speed(&self, joint: Joint) -> Speed {
        Speed::from_steps(self.registers.at(SPEED.of(joint))).unwrap_or(Speed::MAXIMUM)
    }

    /// Register 29.
    pub(crate) fn motor_state(&self) -> u8 {
        self.registers.byte(&MOTOR_STATE)
    }

    /// Does the joint's set-point move? `false` without a status block.
    pub(crate) fn is_moving(&self, joint: Joint) -> bool {
        self.status.as_ref().is_some_and(|status| status.is_moving(joint))
    }

    /// Does the joint's servo not answer?
    pub(crate) fn is_missing(&self, joint: Joint) -> bool {
        self.status.as_ref().is_some_and(|status| status.is_missing(joint))
    }
}
