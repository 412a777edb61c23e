//! How fast a move is.

use super::error::MoveError;
use crate::arm::Arm;
use crate::fine_state::FineTargets;
use crate::joints::frames_for;
use crate::units::{MoveTime, Speed};
use protocol_core::registers::map::{SPEED, TIME};

/// How fast a move is: a speed, a duration, or what the arm has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pace {
    /// The speed of the joints.
    pub speed: Option<Speed>,
    /// The duration of the move. A duration applies at the maximum speed, so this sets the speed, too (D11).
    pub time: Option<MoveTime>,
}

impl Pace {
    /// Sets speed and duration of the joints with a target.
    ///
    /// # Errors
    /// The arm does not take the values, or an exchange failed.
    pub fn set(self, arm: &mut Arm, targets: &FineTargets) -> Result<(), MoveError> {
        let for_targets = |steps: u8| targets.map(|target| target.map(|_| steps));
        let speed = self.speed.or(self.time.map(|_| Speed::MAXIMUM));
        let speeds = speed.map(|speed| frames_for(&SPEED, &for_targets(speed.steps())));
        let times = self.time.map(|time| frames_for(&TIME, &for_targets(time.steps())));
        let frames: Vec<_> = speeds.into_iter().chain(times).flatten().collect();
        if frames.is_empty() {
            return Ok(());
        }
        Ok(arm.write_all_checked(&frames)?)
    }
}
