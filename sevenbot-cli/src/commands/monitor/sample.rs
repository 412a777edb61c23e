//! A sample of the arm: one or two reads, and the round-trip time of the first.

use std::time::{Duration, Instant};

use sevenbot::cartesian::{TipPose, Vector};
use sevenbot::fine::FineState;
use sevenbot::joints::JointSnapshot;
use sevenbot::{Angle, Arm, Error, Health, Joint, StatusBlock};

/// The state of an arm at one time.
#[derive(Clone, Debug)]
pub(crate) struct ArmSample {
    /// The time since the start of the monitor.
    pub(crate) time: Duration,
    pub(crate) joints: JointSnapshot,
    /// Positions in hundredths, velocities and loads; `None` from an arm without the extended block.
    pub(crate) fine: Option<FineState>,
    /// The problems, joint by joint.
    pub(crate) health: Health,
    /// The time from the first request to its reply.
    pub(crate) round_trip: Duration,
}

impl ArmSample {
    /// Reads a sample from the arm.
    pub(crate) fn take(arm: &mut Arm, start: Instant) -> Result<Self, Error> {
        let asked = Instant::now();
        let registers = arm.read_span(JointSnapshot::REGISTERS)?;
        let round_trip = asked.elapsed();
        let all = arm.with_blocks(&registers)?;
        let health = Health::new(&all);
        let fine = all.has_extended_block().then(|| FineState::new(&all));
        let status = health.faults.is_some().then(|| StatusBlock::from(all));
        Ok(Self {
            time: start.elapsed(),
            joints: JointSnapshot::new(registers, status),
            fine,
            health,
            round_trip,
        })
    }

    /// The position of the tip, as exact as the arm measures it; `None` if one of joints 1 to 6 does not answer.
    pub(super) fn tip(&self) -> Option<Vector> {
        if Joint::ALL.into_iter().take(6).any(|joint| self.joints.is_missing(joint)) {
            return None;
        }
        let mut pose = self.joints.positions().map(|degrees| Angle::from_register(degrees).into());
        for (angle, fine) in pose.iter_mut().zip(self.fine.map_or([None; 7], |fine| fine.positions)) {
            *angle = fine.unwrap_or(*angle);
        }
        Some(TipPose::of_fine(pose).tip)
    }
}
