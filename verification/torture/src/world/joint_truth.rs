//! What the servo of a joint truly did: when it lost its torque, and when it pushed too hard.
//!
//! The controller follows both late. So each of them tells for some time what the controller may do (D27, D28).

use motion_core::servo_bus::Torque;
use protocol_core::time::{Duration, Instant};

/// The controller finds within this time that a servo has lost its torque, and that it has torque again. Its shell may
/// stall for five seconds of it.
const NOTICE_TIME: Duration = Duration::from_millis(7_500);
/// A servo that lost its torque without an alarm gets it again within this time.
const ENGAGE_TIME: Duration = Duration::from_millis(10_000);
/// The set-point of a joint that pushed too hard may give way for this time.
const GIVE_WAY_TIME: Duration = Duration::from_millis(7_000);
/// The controller measures a push this much too high at most, in 0.1 %: speed and load are not of the same instant.
const PUSH_ERROR: i16 = 150;

/// The truth about one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct JointTruth {
    is_on: bool,
    /// The last loss of torque in the motor state servo.
    lost_at: Option<Instant>,
    /// The last time without torque after a loss.
    off_at: Instant,
    /// The last alarm. A joint that nothing moves counts as held as long as its servo has an alarm (D28).
    alarm_at: Option<Instant>,
    /// The last push over the limit.
    pushed_at: Option<Instant>,
}

impl JointTruth {
    /// The servo has an alarm.
    pub(super) fn has_alarm(&mut self, now: Instant) {
        self.alarm_at = Some(now);
    }

    /// Takes the torque of the servo, and its push and its limit in 0.1 %.
    pub(super) fn observe(&mut self, now: Instant, torque: Option<Torque>, push: i16, limit: Option<i16>) {
        let is_on = torque == Some(Torque::On);
        if self.is_on && !is_on {
            self.lost_at = Some(now);
        }
        if !is_on {
            self.off_at = now;
        }
        self.is_on = is_on;
        if limit.is_some_and(|limit| push.saturating_abs().saturating_add(PUSH_ERROR) > limit) {
            self.pushed_at = Some(now);
        }
    }

    /// The last loss of torque in this motor state.
    pub(super) const fn lost_at(&self) -> Option<Instant> {
        self.lost_at
    }

    /// True if the controller need not have given torque again by now (D28): the joint was let go a moment ago.
    pub(super) fn may_wait_for_torque(&self, now: Instant) -> bool {
        self.lost_at.max(self.alarm_at).is_some_and(|at| now - at < ENGAGE_TIME)
    }

    /// True if the controller may take the joint for let go (D28): it has an alarm, or it lost its torque, or an alarm kept it
    /// from getting any.
    pub(super) fn may_be_let_go(&self, now: Instant) -> bool {
        let has_alarm = self.alarm_at.is_some_and(|at| now - at < NOTICE_TIME);
        let had_cause = self.lost_at.is_some() || self.alarm_at.is_some();
        has_alarm || had_cause && now - self.off_at < NOTICE_TIME
    }

    /// True if the set-point may give way, or gave way a moment ago (D27).
    pub(super) fn may_give_way(&self, now: Instant) -> bool {
        self.pushed_at.is_some_and(|at| now - at < GIVE_WAY_TIME)
    }
}
