//! The verdict of the limits on a write (D25).

use motion_core::calibration::MicroDegrees;
use protocol_core::registers::map::{
    FRAMES_REFUSED, LAST_REFUSAL, LAST_REFUSED_REGISTER, TARGET_POSITION, limit,
};
use protocol_core::registers::{Joint, RegisterFile};

use super::super::extended_model::{self, LIMITS};
use super::super::host_request::HostRequest;
use super::super::limit_verdict::{CLAW, LINKAGE, LimitVerdict, combined};
use super::RegisterModel;
use crate::per_joint::PerJoint;

impl RegisterModel {
    /// The verdict on a write of these registers. `reached` are the targets of inverse kinematics, from `block` on.
    pub(super) fn limit_verdict(
        &self,
        items: &[(u8, u8)],
        reached: &PerJoint<Option<MicroDegrees>>,
        block: u8,
    ) -> LimitVerdict {
        let before = self.get(LIMITS);
        let after = items.iter().find(|(at, _)| *at == LIMITS).map_or(before, |(_, value)| *value);
        let enters_state = items.iter().any(|(at, _)| *at == 29);
        let written = |joint| written(items, reached, joint);
        let known = |joint| {
            let kept = self
                .fine_target(joint)
                .unwrap_or(MicroDegrees::from_degrees(self.get(TARGET_POSITION.of(joint))));
            written(joint).or((self.has_host_target[joint] && !enters_state).then_some(kept))
        };
        let [_, two, three, .., seven] = Joint::ALL;
        let sum = known(two).zip(known(three)).map(|(two, three)| two.0 + three.0);
        let linkage = sum.map(|sum| LINKAGE.0 <= sum && sum <= LINKAGE.1);
        let claw = known(seven).map(|angle| angle.0 <= CLAW);
        let of = |bit: u8, joints: &[Joint], is_kept: Option<bool>| {
            let at = if before & bit == 0 {
                LIMITS
            } else {
                let addresses = joints.iter().filter_map(|joint| written_at(items, reached, block, *joint));
                addresses.min()?
            };
            (after & bit != 0).then_some(match is_kept {
                Some(false) => LimitVerdict::Refused(at),
                Some(true) if at != LIMITS => LimitVerdict::Allowed,
                _ => LimitVerdict::Unknown(at),
            })
        };
        let verdicts = [of(limit::LINKAGE, &[two, three], linkage), of(limit::CLAW, &[seven], claw)];
        combined(verdicts.map(|verdict| verdict.unwrap_or(LimitVerdict::Allowed)))
    }

    /// True if the arm, with these registers, has refused what it must have refused by `requests` if the first of them
    /// with an unknown verdict is refused (`refuses`).
    pub(crate) fn explains(
        &self,
        registers: &RegisterFile,
        requests: &[&HostRequest],
        room: usize,
        refuses: bool,
    ) -> bool {
        let [first, rest @ ..] = requests else { return self.has_refusals_of(registers) };
        let mut trial = self.clone();
        trial.refuses_unknown = refuses;
        trial.execute(first, room);
        trial.explains(registers, rest, room, false)
            || (rest
                .iter()
                .any(|request| matches!(request, HostRequest::Write { .. } | HostRequest::WriteMap21 { .. }))
                && trial.get(LIMITS) != 0
                && rest.len() < 8
                && trial.explains(registers, rest, room, true))
    }

    fn has_refusals_of(&self, registers: &RegisterFile) -> bool {
        let addresses = [
            FRAMES_REFUSED.address,
            FRAMES_REFUSED.address + 1,
            LAST_REFUSAL.address,
            LAST_REFUSED_REGISTER.address,
        ];
        addresses.into_iter().all(|at| self.get(at) == registers.get(at))
    }
}

/// The target of a joint after a write of it. The last of several counts.
fn written(
    items: &[(u8, u8)],
    reached: &PerJoint<Option<MicroDegrees>>,
    joint: Joint,
) -> Option<MicroDegrees> {
    let coarse = || {
        items
            .iter()
            .find(|(at, _)| *at == TARGET_POSITION.of(joint))
            .map(|(_, value)| MicroDegrees::from_degrees(*value))
    };
    let fine = || {
        extended_model::fine_targets(items)
            .find(|(of, _)| *of == joint)
            .map(|(_, value)| MicroDegrees(i32::from(value) * 10_000))
    };
    reached[joint].or_else(fine).or_else(coarse)
}

fn written_at(
    items: &[(u8, u8)],
    reached: &PerJoint<Option<MicroDegrees>>,
    block: u8,
    joint: Joint,
) -> Option<u8> {
    let has = |wanted| items.iter().any(|(at, _)| *at == wanted).then_some(wanted);
    let by_block = || reached[joint].map(|_| block);
    has(TARGET_POSITION.of(joint)).or_else(by_block).or_else(|| has(extended_model::fine_target(joint)))
}
