//! Corrupted replies with a valid checksum, one in 256: the controller may use a false reading.

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use crate::per_joint::PerJoint;

/// The controller may accept a false reading if two undetected errors come within this time.
const MISREAD_TIME: Duration = Duration::from_millis(1_000);
/// The largest error of a single false reading at which a joint engages, in counts: 8 for a joint at rest. A joint that sinks
/// slowly and is read four times a second has 15 more.
const TOLERANCE: u64 = 8 + 15;

/// The undetected errors of all servos.
#[derive(Debug, Default)]
pub(super) struct Misreadings {
    /// The last undetected error in a reply of each servo.
    error_at: PerJoint<Option<Instant>>,
    used_until: PerJoint<Instant>,
}

impl Misreadings {
    /// Records an undetected error in a reply of this servo.
    pub(super) fn undetected_error(&mut self, now: Instant, joint: Joint) {
        if self.was_error(joint, now) {
            self.used_until[joint] = now + MISREAD_TIME;
        }
        self.error_at[joint] = Some(now);
    }

    fn was_error(&self, joint: Joint, now: Instant) -> bool {
        self.error_at[joint].is_some_and(|at| now - at < MISREAD_TIME)
    }

    /// True if the controller may use a false reading of this joint.
    pub(super) fn may_be_used(&self, joint: Joint, now: Instant) -> bool {
        now < self.used_until[joint]
    }

    /// The time until which the controller may use a false reading of this joint.
    pub(super) fn may_be_used_until(&self, joint: Joint) -> Instant {
        self.used_until[joint]
    }

    /// The accepted error of a position reading, in counts: [`TOLERANCE`] for [`MISREAD_TIME`] after an undetected error,
    /// otherwise 0.
    pub(super) fn tolerance(&self, joint: Joint, now: Instant) -> u64 {
        if self.was_error(joint, now) { TOLERANCE } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_error_is_a_small_one_and_two_in_a_second_may_be_used() {
        let at = |millis: u64| Instant::from_micros(millis * 1_000);
        let [joint, other, ..] = Joint::ALL;
        let mut misreadings = Misreadings::default();
        assert_eq!((misreadings.may_be_used(joint, at(0)), misreadings.tolerance(joint, at(0))), (false, 0));
        misreadings.undetected_error(at(100), joint);
        assert_eq!(
            (misreadings.may_be_used(joint, at(100)), misreadings.tolerance(joint, at(100))),
            (false, 23)
        );
        assert_eq!(misreadings.tolerance(joint, at(1_100)), 0);
        misreadings.undetected_error(at(1_100), joint);
        assert!(!misreadings.may_be_used(joint, at(1_100)), "a second later");
        misreadings.undetected_error(at(2_099), joint);
        assert!(misreadings.may_be_used(joint, at(3_098)) && !misreadings.may_be_used(joint, at(3_099)));
        assert!(!misreadings.may_be_used(other, at(2_099)));
    }
}
