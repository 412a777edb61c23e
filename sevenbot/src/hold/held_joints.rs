//! The joints of an arm that has to hold: which targets hold them, and which of these were lost.

use protocol_core::registers::map::{FINE_POSITION, FINE_TARGET, LIMITS, TARGET_POSITION};
use protocol_core::registers::{Joint, Register};

use crate::checked_write::{MismatchCause, WriteMismatch, cause_from_counters};
use crate::fine::fine_frames;
use crate::fine_angle::FineAngle;
use crate::joints::{JointSnapshot, frames_for};
use crate::status_block::StatusBlock;
use host_link::sharing::DROOP;
use host_link::{Snapshot, Span, keep_limits};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SentTarget {
    /// The raw value of the register.
    pub(super) value: u16,
    /// The target is 0, and the joint was possibly not measured.
    pub(super) may_be_unmeasured: bool,
}

/// The joints of an arm that has to hold.
#[derive(Clone, Debug)]
pub struct HeldJoints {
    /// Targets and positions in hundredths of a degree, from an arm with the extended block.
    fine: Option<Snapshot>,
    pub(super) joints: JointSnapshot,
}

impl HeldJoints {
    /// The registers to read for the second argument of [`Self::new`] from an arm with the extended block.
    pub const FINE_REGISTERS: Span = Span::between(&FINE_TARGET, &LIMITS);

    /// `fine` is a read that holds [`Self::FINE_REGISTERS`]; `None` for an arm without the extended block.
    #[must_use]
    pub const fn new(joints: JointSnapshot, fine: Option<Snapshot>) -> Self {
        Self { fine, joints }
    }

    /// From registers 0 to 255, with 0 in the registers of each block that the firmware lacks.
    #[must_use]
    pub fn of(registers: &Snapshot) -> Self {
        let status = registers.has_status_block().then(|| StatusBlock::from(registers.clone()));
        let fine = registers.has_extended_block().then(|| registers.clone());
        Self::new(JointSnapshot::new(registers.clone(), status), fine)
    }

    /// Does the arm have the extended block?
    pub(super) const fn is_fine(&self) -> bool {
        self.fine.is_some()
    }

    const fn row(&self) -> &'static Register {
        if self.fine.is_some() { &FINE_TARGET } else { &TARGET_POSITION }
    }

    fn target(&self, joint: Joint) -> u16 {
        let coarse = || self.joints.target(joint).into();
        self.fine.as_ref().map_or_else(coarse, |fine| fine.word(FINE_TARGET.of(joint)))
    }

    /// Is the joint possibly not measured yet?
    pub(super) fn may_be_unmeasured(&self, joint: Joint, is_past_start_up: bool) -> bool {
        if self.fine.is_none() {
            return self.joints.may_be_unmeasured(joint, is_past_start_up);
        }
        let is_start_up_over = is_past_start_up || self.joints.missing() != 0;
        !is_start_up_over && self.measured(joint).is_none()
    }

    /// The measured position in hundredths of a degree; `None` without the extended block, or if the joint was not measured
    /// since power-up.
    fn measured(&self, joint: Joint) -> Option<u16> {
        let position = self.fine.as_ref()?.word(FINE_POSITION.of(joint));
        FineAngle::from_hundredths(position).map(FineAngle::hundredths)
    }

    /// The targets to write now so that the joints hold, after `sent` was written.
    pub(super) fn targets_to_write(
        &self,
        sent: &[Option<SentTarget>; 7],
        is_past_start_up: bool,
    ) -> [Option<u16>; 7] {
        let mut targets = [None; 7];
        for ((target, sent), joint) in targets.iter_mut().zip(sent).zip(Joint::ALL) {
            let is_done = sent.is_some_and(|sent| {
                let is_measured_now = sent.may_be_unmeasured && self.joints.present(joint) != 0;
                self.target(joint) == sent.value && !is_measured_now
            });
            *target = self.hold_target(joint, is_past_start_up).filter(|_| !is_done);
        }
        if let Some(fine) = &self.fine {
            keep_limits(fine.byte(&LIMITS), &fine.words(&FINE_TARGET), &mut targets);
        }
        targets
    }

    /// The position at which the joint has to hold; `None` if it is unknown.
    fn hold_target(&self, joint: Joint, is_past_start_up: bool) -> Option<u16> {
        if self.fine.is_some() {
            let measured = self.measured(joint)?;
            return Some(if self.rests_at_target(joint, measured) { self.target(joint) } else { measured });
        }
        let joints = &self.joints;
        let present = joints.present(joint);
        let is_unknown = present == 0 && joints.is_missing(joint);
        // A joint that moves at position 0 cannot wait: it has just left 0 degrees, or start-up is not over. During start-up the
        // arm does not drive a joint that is not measured, and a later read replaces this target.
        let can_wait = self.may_be_unmeasured(joint, is_past_start_up) && !joints.is_moving(joint);
        (!is_unknown && !can_wait).then_some(present.into())
    }

    /// Does the joint rest at its target? Then it keeps the target ([D24](protocol_core::decisions#d24)): if the measured
    /// position became the target, the joint would droop below it by the same distance again.
    fn rests_at_target(&self, joint: Joint, measured: u16) -> bool {
        let is_silent = self.joints.status.is_none() || self.joints.is_missing(joint);
        !is_silent && !self.joints.is_moving(joint) && self.target(joint).abs_diff(measured) <= DROOP
    }

    /// The frames that write these targets.
    pub(super) fn frames(&self, targets: &[Option<u16>; 7]) -> Vec<(u8, Vec<u8>)> {
        if self.fine.is_some() {
            return fine_frames(&targets.map(|target| FineAngle::from_hundredths(target?)));
        }
        frames_for(&TARGET_POSITION, &targets.map(|target| u8::try_from(target?).ok()))
    }

    /// The targets of the arm that differ from the targets that were sent.
    pub(super) fn lost_targets(
        &self,
        sent: &[Option<SentTarget>; 7],
        before: &JointSnapshot,
    ) -> Vec<WriteMismatch> {
        let cause = match (&before.status, &self.joints.status) {
            (Some(before), Some(after)) => cause_from_counters(before, after),
            _ => MismatchCause::Unknown,
        };
        let pairs = Joint::ALL.into_iter().zip(sent).filter_map(|(joint, sent)| Some((joint, (*sent)?)));
        pairs
            .map(|(joint, sent)| (joint, sent.value, self.target(joint)))
            .filter(|(_, wanted, found)| wanted != found)
            .map(|(joint, wanted, found)| WriteMismatch {
                address: self.row().of(joint),
                wanted,
                found,
                cause,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joints::tests::{self, POSE};
    use protocol_core::registers::map::limit;

    const NOTHING_SENT: [Option<SentTarget>; 7] = [None; 7];

    fn coarse(joints: JointSnapshot) -> HeldJoints {
        HeldJoints { fine: None, joints }
    }

    fn joint_snapshot(targets: [u8; 7], positions: [u8; 7], missing: u8, moving: u8) -> HeldJoints {
        coarse(tests::joint_snapshot(targets, positions, missing, moving))
    }

    fn power_up(positions: [u8; 7], missing: u8, moving: u8) -> HeldJoints {
        coarse(tests::power_up(positions, missing, moving))
    }

    fn held(pose: [u8; 7]) -> [Option<u16>; 7] {
        pose.map(|degrees| Some(degrees.into()))
    }

    #[test]
    fn every_measured_joint_is_held_where_it_is() {
        let joints = joint_snapshot([170, 90, 65, 90, 90, 90, 80], POSE, 0, 1);
        assert_eq!(joints.targets_to_write(&NOTHING_SENT, false), held(POSE));
        assert!(!joints.may_be_unmeasured(Joint::ALL[0], false));
    }

    #[test]
    fn only_targets_that_differ_are_written_again() {
        let sent = POSE.map(|degrees| Some(SentTarget { value: degrees.into(), may_be_unmeasured: false }));
        assert_eq!(joint_snapshot(POSE, POSE, 0, 0).targets_to_write(&sent, false), [None; 7]);
        let lost = joint_snapshot([170, 90, 65, 90, 90, 90, 80], [125, 90, 65, 90, 90, 90, 80], 0, 1);
        let again = lost.targets_to_write(&sent, false);
        assert_eq!(again, [Some(125), None, None, None, None, None, None], "from where it is by now");
    }

    #[test]
    fn a_joint_moving_from_0_degrees_is_stopped_at_once() {
        let joints = joint_snapshot([170, 90, 65, 90, 90, 90, 80], [0, 90, 65, 90, 90, 90, 80], 0, 1);
        assert_eq!(joints.targets_to_write(&NOTHING_SENT, false)[0], Some(0));
        assert!(joints.may_be_unmeasured(Joint::ALL[0], false), "it may be start-up: look again");
        let at_rest = joint_snapshot([0, 90, 65, 90, 90, 90, 80], [0, 90, 65, 90, 90, 90, 80], 0, 0);
        assert!(
            !at_rest.may_be_unmeasured(Joint::ALL[0], false),
            "at rest at 0 degrees it was measured there"
        );
    }

    #[test]
    fn a_joint_that_is_not_measured_yet_is_not_sent_to_zero() {
        let joints = power_up([0; 7], 0, 0);
        assert_eq!(joints.targets_to_write(&NOTHING_SENT, false), [None; 7]);
        assert!(joints.may_be_unmeasured(Joint::ALL[0], false));
        assert_eq!(joints.targets_to_write(&NOTHING_SENT, true)[0], Some(0), "after start-up 0 is 0 degrees");
        let another_is_missing = power_up([0; 7], 0b10, 0);
        assert_eq!(another_is_missing.targets_to_write(&NOTHING_SENT, false)[0], Some(0), "start-up is over");
    }

    #[test]
    fn a_target_of_start_up_is_replaced_as_soon_as_the_joint_is_measured() {
        let sent = [Some(SentTarget { value: 0, may_be_unmeasured: true }); 7];
        let joints = joint_snapshot([0; 7], POSE, 0, 0x7F);
        assert_eq!(joints.targets_to_write(&sent, false), held(POSE));
    }

    #[test]
    fn a_missing_joint_is_held_at_its_last_measured_position() {
        let joints = joint_snapshot([170, 90, 170, 90, 90, 90, 80], [120, 90, 0, 90, 90, 90, 80], 0b101, 0);
        let held = joints.targets_to_write(&NOTHING_SENT, true);
        assert_eq!((held[0], held[2]), (Some(120), None));
    }

    #[test]
    fn d24_a_joint_that_has_reached_its_target_keeps_it() {
        // Joint 1 moves, joint 2 stands lower by its weight, joint 3 by an obstacle, and joint 4 is silent.
        let targets = [9_000, 9_000, 9_000, 9_000, 9_000, 9_000, 9_000_u16];
        let positions = [8_950, 8_900, 8_700, 8_900, 9_000, 9_000, 9_000_u16];
        let values = targets.into_iter().chain(positions).flat_map(u16::to_le_bytes).collect();
        let fine = Some(Snapshot { address: FINE_TARGET.address, values });
        let now = HeldJoints { fine, joints: tests::joint_snapshot(POSE, POSE, 0b1000, 0b1) };
        let held = now.targets_to_write(&NOTHING_SENT, false);
        assert_eq!(held[..5], [Some(8_950), Some(9_000), Some(8_700), Some(8_900), Some(9_000)]);
    }

    #[test]
    fn d25_targets_that_hold_stay_within_the_limits() {
        let targets = [9_000, 7_600, 15_000, 9_000, 9_000, 9_000, 8_000_u16];
        let positions = [9_500, 12_900, 9_900, 9_000, 9_000, 9_000, 8_000_u16];
        let mut values: Vec<u8> = targets.into_iter().chain(positions).flat_map(u16::to_le_bytes).collect();
        values.resize(usize::from(HeldJoints::FINE_REGISTERS.count()), 0);
        for (limits, joint_2) in [(0, 12_900), (limit::LINKAGE, 12_700)] {
            values[usize::from(LIMITS.address - FINE_TARGET.address)] = limits;
            let fine = Some(Snapshot { address: FINE_TARGET.address, values: values.clone() });
            let now = HeldJoints { fine, joints: tests::joint_snapshot(POSE, POSE, 0, 0b111) };
            let held = now.targets_to_write(&NOTHING_SENT, false);
            assert_eq!(held[..3], [Some(9_500), Some(joint_2), Some(9_900)]);
        }
    }

    #[test]
    fn an_arm_with_hundredths_is_held_where_it_was_measured() {
        let mut values = vec![0; 28];
        values[0..4].copy_from_slice(&[0x28, 0x23, 0x28, 0x23]);
        values[14..18].copy_from_slice(&[0xFF, 0xFF, 0x2D, 0x23]);
        let fine = Some(Snapshot { address: FINE_TARGET.address, values });
        let now = HeldJoints { fine, joints: tests::power_up(POSE, 0, 0b11) };
        let targets = now.targets_to_write(&NOTHING_SENT, false);
        assert_eq!(targets[..3], [None, Some(9_005), Some(0)], "joint 1 was not measured");
        assert_eq!(now.frames(&targets)[0].0, FINE_TARGET.address + 2);
        assert!(now.may_be_unmeasured(Joint::ALL[0], false), "it is waited for");
        assert!(!now.may_be_unmeasured(Joint::ALL[2], false), "0 was measured");
        let sent = [Some(SentTarget { value: 9_005, may_be_unmeasured: false }); 7];
        let lost = now.lost_targets(&sent, &now.joints);
        assert_eq!((lost[0].address, lost[0].wanted, lost[0].found), (128, 9_005, 9_000));
    }
}
