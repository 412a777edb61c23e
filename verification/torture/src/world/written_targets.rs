//! The targets in a write, in all three forms: degrees, hundredths, and positions of inverse kinematics.

use motion_core::calibration::MicroDegrees;
use protocol_core::registers::Joint;
use protocol_core::registers::map::TARGET_POSITION;

use super::extended_model;
use crate::per_joint::PerJoint;

/// The targets that a write sets.
pub(crate) struct WrittenTargets<'a> {
    pub(crate) items: &'a [(u8, u8)],
    /// The targets from inverse kinematics.
    pub(crate) reached: PerJoint<Option<MicroDegrees>>,
    /// The first register of the position from which `reached` was computed.
    pub(crate) block: u8,
}

impl WrittenTargets<'_> {
    /// The value of a register in the write.
    pub(crate) fn value_at(&self, wanted: u8) -> Option<u8> {
        self.items.iter().find(|(at, _)| *at == wanted).map(|(_, value)| *value)
    }

    /// The target of a joint. If the write sets several, the arm applies them in the order coarse, fine, inverse kinematics.
    pub(crate) fn of(&self, joint: Joint) -> Option<MicroDegrees> {
        let fine = || extended_model::fine_targets(self.items).find(|(of, _)| *of == joint);
        let fine = || fine().map(|(_, hundredths)| extended_model::angle(hundredths));
        let coarse = || self.value_at(TARGET_POSITION.of(joint)).map(MicroDegrees::from_degrees);
        self.reached[joint].or_else(fine).or_else(coarse)
    }

    /// The first register that sets the target of one of the joints.
    pub(crate) fn first_register(&self, joints: &[Joint]) -> Option<u8> {
        let has = |at| self.value_at(at).map(|_| at);
        let of = |joint: &Joint| {
            let reached = self.reached[*joint].map(|_| self.block);
            let fine = has(extended_model::fine_target(*joint));
            [has(TARGET_POSITION.of(*joint)), reached, fine].into_iter().flatten().min()
        };
        joints.iter().filter_map(of).min()
    }
}
