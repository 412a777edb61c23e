//! A stop that is verified: the targets that hold the arm are written, read back, and written again where they differ.
//!
//! ```text
//!   look at the joints ──▶ targets that hold them ──▶ write ──▶ look again, until nothing is left to write
//! ```
//!
//! Knows what to write; what the registers say of a joint is in [`crate::joints`].

use std::fmt;
use std::thread::sleep;
use std::time::Instant;

use protocol_core::registers::Joint;
use protocol_core::registers::map::TARGET_POSITION;

use crate::arm::Arm;
use crate::change::{Cause, Unchanged, verdict};
use crate::error::Error;
use crate::joints::{JointSnapshot, LOOK_EVERY, START_UP, frames_for};

/// How often targets are written before their loss counts as a failure.
const HOLD_ATTEMPTS: u32 = 5;

/// Why it is not known that the arm holds.
///
/// ```
/// use sevenbot::hold::NotHeld;
///
/// let reason = NotHeld::NotTaken(Vec::new());
/// assert!(reason.to_string().contains("did not take"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotHeld {
    /// The arm could not be asked.
    Wire(Error),
    /// The targets do not hold what was written, however often it was.
    NotTaken(Vec<Unchanged>),
}

impl From<Error> for NotHeld {
    fn from(error: Error) -> Self {
        Self::Wire(error)
    }
}

impl fmt::Display for NotHeld {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wire(error) => error.fmt(out),
            Self::NotTaken(unchanged) => {
                out.write_str("the arm did not take the targets that hold it")?;
                unchanged.first().map_or(Ok(()), |first| write!(out, ": {first}"))
            }
        }
    }
}

impl std::error::Error for NotHeld {}

/// A target that a stop has written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sent {
    degrees: u8,
    /// It was 0, and may not have been measured.
    was_doubtful: bool,
}

const NOTHING_SENT: [Option<Sent>; 7] = [None; 7];

impl Arm {
    /// Makes every joint hold where it is, and makes sure that it took: the targets are written, read back, and written
    /// again where they differ. Returns the joints as they were read back.
    ///
    /// Where the motors do not drive the joints (state 0 or 2) there is nothing to write. A joint whose servo is silent
    /// gets the position that was measured last as its target, for the time when it answers again; one that was never
    /// measured is left alone. A joint that may not be measured yet, because the arm was just switched on, is waited
    /// for, up to 0.7 s; the others are held before.
    ///
    /// # Errors
    /// No answer, or the arm does not take the targets: it may be moving.
    pub fn hold(&mut self) -> Result<JointSnapshot, NotHeld> {
        self.patiently(Self::hold_until_seen)
    }

    fn hold_until_seen(&mut self) -> Result<JointSnapshot, NotHeld> {
        let start = Instant::now();
        let mut before = None;
        let mut sent = NOTHING_SENT;
        let mut losses = 0;
        loop {
            let joints = self.joints()?;
            if !joints.is_driven() {
                return Ok(joints);
            }
            let is_up = start.elapsed() >= START_UP;
            let before: &JointSnapshot = before.get_or_insert_with(|| joints.clone());
            let lost = joints.lost(&sent, before);
            losses += u32::from(!lost.is_empty());
            if losses >= HOLD_ATTEMPTS {
                return Err(NotHeld::NotTaken(lost));
            }
            let targets = joints.to_hold(&sent, is_up);
            for (address, degrees) in frames_for(&TARGET_POSITION, &targets) {
                self.write(address, &degrees)?;
            }
            for ((sent, target), joint) in sent.iter_mut().zip(targets).zip(Joint::ALL) {
                let was_doubtful = joints.is_doubtful(joint, is_up);
                *sent = target.map(|degrees| Sent { degrees, was_doubtful }).or(*sent);
            }
            if targets == [None; 7] {
                if !Joint::ALL.into_iter().any(|joint| joints.is_doubtful(joint, is_up)) {
                    return Ok(joints);
                }
                sleep(LOOK_EVERY);
            }
        }
    }
}

impl JointSnapshot {
    /// The targets to write now, so that the joints hold where they are, after `sent` was written.
    fn to_hold(&self, sent: &[Option<Sent>; 7], is_up: bool) -> [Option<u8>; 7] {
        let mut targets = [None; 7];
        for ((target, sent), joint) in targets.iter_mut().zip(sent).zip(Joint::ALL) {
            let is_done = sent.is_some_and(|sent| {
                let is_measured_now = sent.was_doubtful && self.present(joint) != 0;
                self.target(joint) == sent.degrees && !is_measured_now
            });
            *target = self.place_to_hold(joint, is_up).filter(|_| !is_done);
        }
        targets
    }

    /// Where the joint is to be held; `None` while that is not known.
    fn place_to_hold(&self, joint: Joint, is_up: bool) -> Option<u8> {
        let present = self.present(joint);
        let is_unknown = present == 0 && self.is_missing(joint);
        // A doubtful joint on its way has left 0 degrees just now, or another host sent it somewhere during start-up.
        // It cannot wait, and in start-up it is not driven before it was measured, which the next look shows.
        let may_wait = self.is_doubtful(joint, is_up) && !self.is_moving(joint);
        (!is_unknown && !may_wait).then_some(present)
    }

    /// The targets that do not hold what was sent.
    fn lost(&self, sent: &[Option<Sent>; 7], before: &Self) -> Vec<Unchanged> {
        let cause = match (&before.status, &self.status) {
            (Some(before), Some(after)) => verdict(before, after),
            _ => Cause::Unknown,
        };
        let pairs = Joint::ALL.into_iter().zip(sent).filter_map(|(joint, sent)| Some((joint, (*sent)?)));
        pairs
            .map(|(joint, sent)| (joint, sent.degrees, self.target(joint)))
            .filter(|(_, wanted, found)| wanted != found)
            .map(|(joint, wanted, found)| Unchanged {
                address: TARGET_POSITION.of(joint),
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
    use crate::joints::tests::{UP, look, power_up};

    #[test]
    fn every_measured_joint_is_held_where_it_is() {
        let joints = look([170, 90, 65, 90, 90, 90, 80], UP, 0, 1);
        assert_eq!(joints.to_hold(&NOTHING_SENT, false), UP.map(Some));
        assert!(!joints.is_doubtful(Joint::ALL[0], false));
    }

    #[test]
    fn what_was_written_is_written_again_only_where_it_did_not_take() {
        let sent = UP.map(|degrees| Some(Sent { degrees, was_doubtful: false }));
        assert_eq!(look(UP, UP, 0, 0).to_hold(&sent, false), [None; 7]);
        let lost = look([170, 90, 65, 90, 90, 90, 80], [125, 90, 65, 90, 90, 90, 80], 0, 1);
        let again = lost.to_hold(&sent, false);
        assert_eq!(again, [Some(125), None, None, None, None, None, None], "from where it is by now");
    }

    #[test]
    fn a_joint_that_leaves_zero_degrees_is_stopped_at_once() {
        let joints = look([170, 90, 65, 90, 90, 90, 80], [0, 90, 65, 90, 90, 90, 80], 0, 1);
        assert_eq!(joints.to_hold(&NOTHING_SENT, false)[0], Some(0));
        assert!(joints.is_doubtful(Joint::ALL[0], false), "it may be start-up: look again");
        let at_rest = look([0, 90, 65, 90, 90, 90, 80], [0, 90, 65, 90, 90, 90, 80], 0, 0);
        assert!(!at_rest.is_doubtful(Joint::ALL[0], false), "at rest at 0 degrees it was measured there");
    }

    #[test]
    fn a_joint_that_is_not_measured_yet_is_not_sent_to_zero() {
        let joints = power_up([0; 7], 0, 0);
        assert_eq!(joints.to_hold(&NOTHING_SENT, false), [None; 7]);
        assert!(joints.is_doubtful(Joint::ALL[0], false));
        assert_eq!(joints.to_hold(&NOTHING_SENT, true)[0], Some(0), "after start-up 0 is 0 degrees");
        let another_is_missing = power_up([0; 7], 0b10, 0);
        assert_eq!(another_is_missing.to_hold(&NOTHING_SENT, false)[0], Some(0), "start-up is over");
    }

    #[test]
    fn a_target_of_start_up_is_replaced_as_soon_as_the_joint_is_measured() {
        let sent = [Some(Sent { degrees: 0, was_doubtful: true }); 7];
        let joints = look([0; 7], UP, 0, 0x7F);
        assert_eq!(joints.to_hold(&sent, false), UP.map(Some));
    }

    #[test]
    fn a_silent_joint_is_held_where_it_was_measured_last_and_never_at_zero() {
        let joints = look([170, 90, 170, 90, 90, 90, 80], [120, 90, 0, 90, 90, 90, 80], 0b101, 0);
        let held = joints.to_hold(&NOTHING_SENT, true);
        assert_eq!((held[0], held[2]), (Some(120), None));
    }
}
