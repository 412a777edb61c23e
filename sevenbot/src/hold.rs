//! A verified stop: writes targets that hold the arm, reads them back, and writes those again that differ.
//!
//! ```text
//!   read the joints ──▶ targets that hold them ──▶ write ──▶ read again, until no target differs
//! ```
//!
//! [`crate::joints`] interprets the registers of each joint.

use protocol_core::registers::Joint;
use protocol_core::registers::map::TARGET_POSITION;

use crate::arm::Arm;
use crate::checked_write::{MismatchCause, WriteMismatch, cause_from_counters};
use crate::error::Error;
use crate::joints::{JointSnapshot, POLL_PERIOD, START_UP_TIME, frames_for};

/// Targets are written this many times before their loss is an error.
const HOLD_ATTEMPTS: u32 = 5;

/// Why the arm may not hold.
///
/// ```
/// use sevenbot::hold::HoldError;
///
/// let reason = HoldError::NotTaken(Vec::new());
/// assert!(reason.to_string().contains("did not take"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HoldError {
    /// An exchange with the arm failed.
    #[error(transparent)]
    Exchange(#[from] Error),
    /// These targets differ from what was written several times.
    #[error("the arm did not take the targets that hold it{}", first_of(.0))]
    NotTaken(Vec<WriteMismatch>),
}

fn first_of(unchanged: &[WriteMismatch]) -> String {
    unchanged.first().map_or(String::new(), |first| format!(": {first}"))
}

/// A target that was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SentTarget {
    degrees: u8,
    /// The target is 0, and the joint was possibly not measured.
    may_be_unmeasured: bool,
}

const NOTHING_SENT: [Option<SentTarget>; 7] = [None; 7];

impl Arm {
    /// Makes every joint hold its present position, and verifies the targets. Returns the joints as read back.
    ///
    /// - If the motors do not drive the joints (state 0 or 2), writes nothing.
    /// - A joint whose servo does not answer gets its last measured position as its target, and none if it was never
    ///   measured.
    /// - After power-up waits up to 0.7 s for the joints that are not measured yet. The other joints hold at once.
    ///
    /// # Errors
    /// No answer, or the arm does not take the targets: it may be moving.
    pub fn hold(&mut self) -> Result<JointSnapshot, HoldError> {
        self.with_min_attempts(Self::hold_until_verified)
    }

    fn hold_until_verified(&mut self) -> Result<JointSnapshot, HoldError> {
        let start = self.now();
        let mut before = None;
        let mut sent = NOTHING_SENT;
        let mut losses = 0;
        loop {
            let joints = self.joints()?;
            if !joints.is_driven() {
                return Ok(joints);
            }
            let is_past_start_up = self.now() >= start + START_UP_TIME;
            let before: &JointSnapshot = before.get_or_insert_with(|| joints.clone());
            let lost = joints.lost_targets(&sent, before);
            losses += u32::from(!lost.is_empty());
            if losses >= HOLD_ATTEMPTS {
                return Err(HoldError::NotTaken(lost));
            }
            let targets = joints.targets_to_write(&sent, is_past_start_up);
            for (address, degrees) in frames_for(&TARGET_POSITION, &targets) {
                self.write(address, &degrees)?;
            }
            for ((sent, target), joint) in sent.iter_mut().zip(targets).zip(Joint::ALL) {
                let may_be_unmeasured = joints.may_be_unmeasured(joint, is_past_start_up);
                *sent = target.map(|degrees| SentTarget { degrees, may_be_unmeasured }).or(*sent);
            }
            if targets == [None; 7] {
                if !Joint::ALL.into_iter().any(|joint| joints.may_be_unmeasured(joint, is_past_start_up)) {
                    return Ok(joints);
                }
                self.sleep(POLL_PERIOD);
            }
        }
    }
}

impl JointSnapshot {
    /// The targets to write now so that the joints hold, after `sent` was written.
    fn targets_to_write(&self, sent: &[Option<SentTarget>; 7], is_past_start_up: bool) -> [Option<u8>; 7] {
        let mut targets = [None; 7];
        for ((target, sent), joint) in targets.iter_mut().zip(sent).zip(Joint::ALL) {
            let is_done = sent.is_some_and(|sent| {
                let is_measured_now = sent.may_be_unmeasured && self.present(joint) != 0;
                self.target(joint) == sent.degrees && !is_measured_now
            });
            *target = self.hold_target(joint, is_past_start_up).filter(|_| !is_done);
        }
        targets
    }

    /// The position at which the joint has to hold; `None` if it is unknown.
    fn hold_target(&self, joint: Joint, is_past_start_up: bool) -> Option<u8> {
        let present = self.present(joint);
        let is_unknown = present == 0 && self.is_missing(joint);
        // A joint that moves at position 0 cannot wait: it has just left 0 degrees, or start-up is not over. In
        // start-up the arm does not drive a joint before it is measured, and the next read shows that.
        let can_wait = self.may_be_unmeasured(joint, is_past_start_up) && !self.is_moving(joint);
        (!is_unknown && !can_wait).then_some(present)
    }

    /// The targets that differ from what was sent.
    fn lost_targets(&self, sent: &[Option<SentTarget>; 7], before: &Self) -> Vec<WriteMismatch> {
        let cause = match (&before.status, &self.status) {
            (Some(before), Some(after)) => cause_from_counters(before, after),
            _ => MismatchCause::Unknown,
        };
        let pairs = Joint::ALL.into_iter().zip(sent).filter_map(|(joint, sent)| Some((joint, (*sent)?)));
        pairs
            .map(|(joint, sent)| (joint, sent.degrees, self.target(joint)))
            .filter(|(_, wanted, found)| wanted != found)
            .map(|(joint, wanted, found)| WriteMismatch {
                address: TARGET_POSITION.of(joint),
                wanted: wanted.into(),
                found: found.into(),
                cause,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joints::tests::{POSE, joint_snapshot, power_up};

    #[test]
    fn every_measured_joint_is_held_where_it_is() {
        let joints = joint_snapshot([170, 90, 65, 90, 90, 90, 80], POSE, 0, 1);
        assert_eq!(joints.targets_to_write(&NOTHING_SENT, false), POSE.map(Some));
        assert!(!joints.may_be_unmeasured(Joint::ALL[0], false));
    }

    #[test]
    fn only_targets_that_differ_are_written_again() {
        let sent = POSE.map(|degrees| Some(SentTarget { degrees, may_be_unmeasured: false }));
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
        let sent = [Some(SentTarget { degrees: 0, may_be_unmeasured: true }); 7];
        let joints = joint_snapshot([0; 7], POSE, 0, 0x7F);
        assert_eq!(joints.targets_to_write(&sent, false), POSE.map(Some));
    }

    #[test]
    fn a_missing_joint_is_held_at_its_last_measured_position() {
        let joints = joint_snapshot([170, 90, 170, 90, 90, 90, 80], [120, 90, 0, 90, 90, 90, 80], 0b101, 0);
        let held = joints.targets_to_write(&NOTHING_SENT, true);
        assert_eq!((held[0], held[2]), (Some(120), None));
    }
}
