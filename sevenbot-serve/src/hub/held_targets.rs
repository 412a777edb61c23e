//! The targets that stops and holds gave to joints, until a write moves or switches something, or the arm is lost.
//!
//! A joint that was stopped brakes past its target and returns to it. Meanwhile the server must not hold it at its measured
//! position: the arm would come to rest at another position than the confirmed one.

use protocol_core::registers::Joint;

use super::angles::JointAngles;
use super::intent::Intent;

/// The longest distance of a braking joint from the target that holds it, in hundredths of a degree. A joint that is farther
/// away is not braking: the program that held it read its position long before.
const LONGEST_BRAKING: u16 = 1_500;

/// The targets that hold joints; `None`: no stop or hold gave the joint a target.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HeldTargets(JointAngles);

impl HeldTargets {
    /// Notes a write to the arm, with this intent and these targets.
    pub(crate) fn note_write(&mut self, intent: Intent, targets: &JointAngles) {
        match intent {
            Intent::Setting => {}
            Intent::Hold | Intent::Stop => {
                for (held, target) in self.0.iter_mut().zip(targets) {
                    *held = target.or(*held);
                }
            }
            Intent::Motion | Intent::Switch | Intent::MotorsOff => *self = Self::default(),
        }
    }

    /// The target that holds a joint which is measured at this position.
    pub(crate) fn near(&self, joint: Joint, position: u16) -> Option<u16> {
        let held = self.0.get(usize::from(joint.index())).copied().flatten();
        held.filter(|held| held.abs_diff(position) <= LONGEST_BRAKING)
    }
}
