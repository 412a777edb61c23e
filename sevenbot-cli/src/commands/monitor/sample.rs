//! A sample of the arm: two reads, and the round-trip time of the first.

use std::time::{Duration, Instant};

use sevenbot::joints::JointSnapshot;
use sevenbot::{Arm, Error};

/// The state of an arm at one time.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// Since the start of the monitor.
    pub(crate) time: Duration,
    pub(crate) joints: JointSnapshot,
    /// From a request to its reply.
    pub(crate) round_trip: Duration,
}

impl Sample {
    /// Reads a sample from the arm.
    pub(crate) fn take(arm: &mut Arm, start: Instant) -> Result<Self, Error> {
        let asked = Instant::now();
        let registers = arm.read_span(JointSnapshot::REGISTERS)?;
        let round_trip = asked.elapsed();
        let joints = JointSnapshot::new(registers, arm.status()?);
        Ok(Self { time: start.elapsed(), joints, round_trip })
    }
}
