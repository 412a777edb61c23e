//! A verified stop: writes targets that hold the arm, reads them back, and writes those again that differ.
//!
//! ```text
//!   read the joints ──▶ targets that hold them ──▶ write ──▶ read again, until no target differs
//! ```
//!
//! On an arm with the extended block, targets are the measured positions in hundredths of a degree, so that a stop moves no
//! joint. On other arms they are whole degrees. [`crate::joints`] interprets the registers of each joint.

use protocol_core::registers::map::{FINE_POSITION, FINE_TARGET, TARGET_POSITION};
use protocol_core::registers::{Joint, Register};

use crate::arm::Arm;
use crate::checked_write::{MismatchCause, NotTaken, WriteError, WriteMismatch, cause_from_counters};
use crate::error::Error;
use crate::fine::fine_frames;
use crate::fine_angle::FineAngle;
use crate::joints::{JointSnapshot, POLL_PERIOD, START_UP_TIME, frames_for};
use host_link::{Snapshot, Span};

/// Targets are written this many times before their loss is an error.
const HOLD_ATTEMPTS: u32 = 5;

/// Why the arm may not hold: it may still be moving.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the arm may not hold: {0}")]
pub struct HoldError(#[from] pub WriteError);

/// A target that was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SentTarget {
    /// The raw value of the register.
    value: u16,
    /// The target is 0, and the joint was possibly not measured.
    may_be_unmeasured: bool,
}

impl Arm {
    /// Makes every joint hold its present position, and verifies the targets. Returns the joints as read back.
    ///
    /// - If the motors do not drive the joints (state 0 or 2), writes nothing.
    /// - A joint whose servo does not answer gets its last measured position as its target, and none if it was never
    ///   measured.
    /// - After power-up waits up to 0.7 s for the joints that are not measured yet. The other joints hold at once.
    /// - A stream of another program ends at each joint. Its set-point period stays as it was ([D23](protocol_core::decisions#d23)).
    ///
    /// # Errors
    /// No answer, or the arm does not take the targets: it may be moving.
    pub fn hold(&mut self) -> Result<JointSnapshot, HoldError> {
        self.hold_through_restarts().map(|(joints, _)| joints)
    }

    /// As [`Arm::hold`]. Also tells whether the controller restarted meanwhile.
    pub(crate) fn hold_through_restarts(&mut self) -> Result<(JointSnapshot, bool), HoldError> {
        let held = self.with_min_attempts(|arm| match arm.has_extended_block()? {
            true => arm.without_set_point_period(|arm| arm.hold_until_verified(true)),
            false => arm.hold_until_verified(false),
        });
        Ok(held?)
    }

    fn hold_until_verified(&mut self, is_fine: bool) -> Result<(JointSnapshot, bool), WriteError> {
        let start = self.now();
        let mut hold = Hold::default();
        loop {
            let now = self.held_joints(is_fine)?;
            match hold.step(&now, self.now() >= start + START_UP_TIME) {
                HoldStep::Holds | HoldStep::NotDriven => return Ok((now.joints, hold.has_restarted)),
                HoldStep::NotTaken(lost) => return Err(lost.into()),
                HoldStep::Wait => self.sleep(POLL_PERIOD),
                HoldStep::Write(frames) => {
                    for (address, values) in frames {
                        self.write(address, &values)?;
                    }
                }
            }
        }
    }

    fn held_joints(&mut self, is_fine: bool) -> Result<HeldJoints, Error> {
        let fine = is_fine.then(|| self.read_span(HeldJoints::FINE_REGISTERS)).transpose()?;
        Ok(HeldJoints::new(self.joints()?, fine))
    }
}

/// A stop in progress, without input and output: [`Arm::hold`] and clients of their own give it what they read.
#[derive(Clone, Debug, Default)]
pub struct Hold {
    /// At the first step.
    before: Option<JointSnapshot>,
    sent: [Option<SentTarget>; 7],
    losses: u32,
    has_restarted: bool,
}

/// What a stop has to do next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HoldStep {
    /// Write these frames, each an address and its values. Then read the joints, and take the next step.
    Write(Vec<(u8, Vec<u8>)>),
    /// A joint is not measured yet. Read the joints again, and take the next step.
    Wait,
    /// Every joint that is known holds: the stop is over.
    Holds,
    /// The motors do not drive the joints: there is nothing to stop.
    NotDriven,
    /// The arm does not take these targets. It may be moving.
    NotTaken(NotTaken),
}

impl Hold {
    /// The next step, given the joints as they are now. `is_past_start_up`: 0.7 s have passed since the first step, after
    /// which each joint is measured or missing.
    pub fn step(&mut self, now: &HeldJoints, is_past_start_up: bool) -> HoldStep {
        if !now.joints.is_driven() {
            return HoldStep::NotDriven;
        }
        if self.before.as_ref().is_some_and(|before| now.joints.has_restarted_since(before)) {
            // What was sent is lost. The arm holds by itself, and measures its joints anew (D12).
            *self = Self { has_restarted: true, ..Self::default() };
        }
        let before = self.before.get_or_insert_with(|| now.joints.clone());
        if let Err(lost) = NotTaken::check(now.lost_targets(&self.sent, before)) {
            self.losses += 1;
            if self.losses >= HOLD_ATTEMPTS {
                return HoldStep::NotTaken(lost);
            }
        }
        let targets = now.targets_to_write(&self.sent, is_past_start_up);
        for ((sent, target), joint) in self.sent.iter_mut().zip(targets).zip(Joint::ALL) {
            let may_be_unmeasured = now.may_be_unmeasured(joint, is_past_start_up);
            *sent = target.map(|value| SentTarget { value, may_be_unmeasured }).or(*sent);
        }
        if targets != [None; 7] {
            return HoldStep::Write(now.frames(&targets));
        }
        let is_waiting = Joint::ALL.into_iter().any(|joint| now.may_be_unmeasured(joint, is_past_start_up));
        if is_waiting { HoldStep::Wait } else { HoldStep::Holds }
    }
}

/// The joints of an arm that has to hold.
#[derive(Clone, Debug)]
pub struct HeldJoints {
    /// Targets and positions in hundredths of a degree, from an arm with the extended block.
    fine: Option<Snapshot>,
    joints: JointSnapshot,
}

impl HeldJoints {
    /// What an arm with the extended block reads for the second argument of [`Self::new`].
    pub const FINE_REGISTERS: Span = Span::between(&FINE_TARGET, &FINE_POSITION);

    /// From the joints, and on an arm with the extended block a read that holds [`Self::FINE_REGISTERS`].
    #[must_use]
    pub const fn new(joints: JointSnapshot, fine: Option<Snapshot>) -> Self {
        Self { fine, joints }
    }

    const fn row(&self) -> &'static Register {
        if self.fine.is_some() { &FINE_TARGET } else { &TARGET_POSITION }
    }

    fn target(&self, joint: Joint) -> u16 {
        let coarse = || self.joints.target(joint).into();
        self.fine.as_ref().map_or_else(coarse, |fine| fine.word(FINE_TARGET.of(joint)))
    }

    /// Is the joint possibly not measured yet?
    fn may_be_unmeasured(&self, joint: Joint, is_past_start_up: bool) -> bool {
        if self.fine.is_none() {
            return self.joints.may_be_unmeasured(joint, is_past_start_up);
        }
        let is_start_up_over = is_past_start_up || self.joints.missing() != 0;
        !is_start_up_over && self.measured(joint).is_none()
    }

    /// The position of a joint that was measured since power-up, if the arm tells that.
    fn measured(&self, joint: Joint) -> Option<u16> {
        let position = self.fine.as_ref()?.word(FINE_POSITION.of(joint));
        FineAngle::from_hundredths(position).map(FineAngle::hundredths)
    }

    /// The targets to write now so that the joints hold, after `sent` was written.
    fn targets_to_write(&self, sent: &[Option<SentTarget>; 7], is_past_start_up: bool) -> [Option<u16>; 7] {
        let mut targets = [None; 7];
        for ((target, sent), joint) in targets.iter_mut().zip(sent).zip(Joint::ALL) {
            let is_done = sent.is_some_and(|sent| {
                let is_measured_now = sent.may_be_unmeasured && self.joints.present(joint) != 0;
                self.target(joint) == sent.value && !is_measured_now
            });
            *target = self.hold_target(joint, is_past_start_up).filter(|_| !is_done);
        }
        targets
    }

    /// The position at which the joint has to hold; `None` if it is unknown.
    fn hold_target(&self, joint: Joint, is_past_start_up: bool) -> Option<u16> {
        if self.fine.is_some() {
            return self.measured(joint);
        }
        let joints = &self.joints;
        let present = joints.present(joint);
        let is_unknown = present == 0 && joints.is_missing(joint);
        // A joint that moves at position 0 cannot wait: it has just left 0 degrees, or start-up is not over. In
        // start-up the arm does not drive a joint before it is measured, and the next read shows that.
        let can_wait = self.may_be_unmeasured(joint, is_past_start_up) && !joints.is_moving(joint);
        (!is_unknown && !can_wait).then_some(present.into())
    }

    /// The frames that write these targets.
    fn frames(&self, targets: &[Option<u16>; 7]) -> Vec<(u8, Vec<u8>)> {
        if self.fine.is_some() {
            return fine_frames(&targets.map(|target| FineAngle::from_hundredths(target?)));
        }
        frames_for(&TARGET_POSITION, &targets.map(|target| u8::try_from(target?).ok()))
    }

    /// The targets that differ from what was sent.
    fn lost_targets(&self, sent: &[Option<SentTarget>; 7], before: &JointSnapshot) -> Vec<WriteMismatch> {
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
