//! A sample of the arm: two or three reads, and the round-trip time of the first.

use std::time::{Duration, Instant};

use sevenbot::fine::FineState;
use sevenbot::joints::JointSnapshot;
use sevenbot::{Arm, Error};

/// The state of an arm at one time.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// Since the start of the monitor.
    pub(crate) time: Duration,
    pub(crate) joints: JointSnapshot,
    /// Positions in hundredths, velocities and loads; `None` from an arm without the extended block.
    pub(crate) fine: Option<FineState>,
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
        let fine = arm.fine_state_if_served()?;
        Ok(Self { time: start.elapsed(), joints, fine, round_trip })
    }
}
