//! Checks a write against the limits of linkage and claw, before it is executed ([D25](protocol_core::decisions#d25)).
//!
//! ```text
//!   write, targets before it ──▶ targets after it ──▶ limits that are on after it ──▶ register that is the reason
//! ```

use protocol_core::registers::map::{FINE_TARGET, LIMITS, TARGET_POSITION, limit};
use protocol_core::registers::{Accepted, JOINTS, Joint};

use crate::calibration::MicroDegrees;
use crate::limits::{claw_allows, linkage_allows};
use crate::reach::Reached;

/// The targets or the set-points that are checked against the limits, one for each joint; `None` for a joint without one.
pub(crate) type AnglesToCheck = [Option<MicroDegrees>; JOINTS];

/// A write that is to be checked.
#[derive(Clone, Copy)]
pub(crate) struct LimitCheck<'a> {
    pub(crate) accepted: &'a Accepted<'a>,
    /// The targets that inverse kinematics finds for a position in the write ([M7](protocol_core::decisions#m7)).
    pub(crate) reached: &'a Reached,
    /// The limits that are on before the write, as bits of [`LIMITS`].
    pub(crate) limits: u8,
}

impl LimitCheck<'_> {
    fn limits_after(&self) -> u8 {
        self.accepted.value_at(LIMITS.address).unwrap_or(self.limits)
    }

    /// The lowest register for which a limit refuses the write; `None` if no limit does. `targets` are the targets before the
    /// write, and `set_points` the set-points of the driven joints.
    pub(crate) fn first_refused(&self, targets: &AnglesToCheck, set_points: &AnglesToCheck) -> Option<u8> {
        let mut after = *targets;
        for (target, joint) in after.iter_mut().zip(Joint::ALL) {
            *target = self.written(joint).or(*target);
        }
        let [_, two, three, .., seven] = Joint::ALL;
        let kept = (linkage_is_kept(&after), linkage_is_kept(set_points));
        let linkage = self.refused_by(limit::LINKAGE, &[two, three], kept);
        let kept = (claw_is_kept(&after), claw_is_kept(set_points));
        let claw = self.refused_by(limit::CLAW, &[seven], kept);
        linkage.into_iter().chain(claw).min()
    }

    /// The register that is reported if `limit` refuses the write; `None` if it does not. `kept` tells whether the
    /// targets after the write and the set-points keep the limit.
    fn refused_by(&self, limit: u8, joints: &[Joint], kept: (bool, bool)) -> Option<u8> {
        let (targets_keep, set_points_keep) = kept;
        if self.limits_after() & limit == 0 {
            return None;
        }
        if self.limits & limit == 0 {
            return (!targets_keep || !set_points_keep).then_some(LIMITS.address);
        }
        let first_written = joints.iter().filter_map(|&joint| self.written_at(joint)).min();
        first_written.filter(|_| !targets_keep)
    }

    /// The target of a joint in the write. If there are several, the last one counts.
    fn written(&self, joint: Joint) -> Option<MicroDegrees> {
        let coarse = || self.accepted.value_at(TARGET_POSITION.of(joint)).map(MicroDegrees::from_degrees);
        let fine = || self.accepted.word_at(FINE_TARGET.of(joint)).map(MicroDegrees::from_centidegrees);
        self.reached.target(joint).or_else(fine).or_else(coarse)
    }

    /// The first register of the write that sets a joint's target.
    fn written_at(&self, joint: Joint) -> Option<u8> {
        let coarse = self.accepted.value_at(TARGET_POSITION.of(joint)).map(|_| TARGET_POSITION.of(joint));
        let fine = || self.accepted.word_at(FINE_TARGET.of(joint)).map(|_| FINE_TARGET.of(joint));
        let reached = || self.reached.target(joint).map(|_| self.reached.address);
        coarse.or_else(reached).or_else(fine)
    }
}

/// Do joints 2 and 3 keep the linkage? They do if the angle of one is missing.
fn linkage_is_kept(angles: &AnglesToCheck) -> bool {
    let [_, two, three, ..] = *angles;
    two.zip(three).is_none_or(|(two, three)| linkage_allows(two, three))
}

fn claw_is_kept(angles: &AnglesToCheck) -> bool {
    let [.., seven] = *angles;
    seven.is_none_or(claw_allows)
}
