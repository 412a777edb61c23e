//! The true history of a joint's servo: when it lost its torque, and when it pushed too hard.
//!
//! The controller notices both late. So its reaction is allowed for some time after each of them (D27, D28).

use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::error;
use protocol_core::time::{Duration, Instant};

use super::status_reply::StatusFields;

/// The controller finds within this time that a servo has lost its torque, and that it has torque again. This includes a
/// stall of the shell of up to five seconds.
const NOTICE_TIME: Duration = Duration::from_millis(7_500);
/// A servo that lost its torque without an alarm gets it again within this time.
const ENGAGE_TIME: Duration = Duration::from_millis(10_000);
/// The set-point of a joint that pushed too hard may give way for this time.
const GIVE_WAY_TIME: Duration = Duration::from_millis(7_000);
/// The largest error by which the controller measures a push too high, in 0.1 %: it samples speed and load at different times.
const PUSH_ERROR: i16 = 150;
/// A joint that was let go because of heat may engage again when its servo is 5 degrees cooler than when it became too hot (D28).
/// It became too hot above its limit, 80 degrees Celsius, so at this temperature it is cool enough.
pub(super) const COOL: u8 = 75;

/// The shortest time from the end of an alarm until its joint engages again: 500 ms (D28), less the delay of an answer.
const ALARM_OVER: Duration = Duration::from_millis(400);

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct JointTruth {
    is_on: bool,
    has_power: bool,
    /// The last loss of power in the motor state servo, or the last time that an alarm switched the motor off. The joint of a servo
    /// that restarts is let go, even if it never had torque (D28).
    unpowered_at: Option<Instant>,
    /// The last loss of torque in the motor state servo.
    lost_at: Option<Instant>,
    /// The last time without torque.
    off_at: Instant,
    /// The last alarm, or the last time that the servo was still hot after one. While the alarm lasts, a joint that
    /// does not move counts as held (D28).
    alarm_at: Option<Instant>,
    /// The last answer with an alarm that ends by itself: heat, or a wrong voltage.
    passing_alarm_at: Option<Instant>,
    /// True if the servo has had no torque since a disturbance: the controller cannot tell a lost torque command from lost
    /// torque.
    lacks_order: bool,
    /// The last push that the controller may measure as over the limit.
    pushed_at: Option<Instant>,
    /// The position of the servo in counts, and the time of its last change.
    position: (u16, Instant),
}

impl JointTruth {
    /// Records an alarm in the last status of the servo. After an alarm the joint may be let go until the servo is cool.
    pub(super) fn reports(&mut self, now: Instant, status: StatusFields) {
        let is_hot = self.alarm_at.is_some() && status.celsius > COOL;
        if status.alarms != 0 || is_hot {
            self.alarm_at = Some(now);
        }
    }

    /// Records an alarm that ends by itself, from an answer of the servo.
    pub(super) fn answers(&mut self, now: Instant, status: StatusFields) {
        if status.alarms & !error::OVERLOAD != 0 {
            self.passing_alarm_at = Some(now);
        }
    }

    /// True if no alarm that ends by itself keeps the joint from engaging again (D28).
    pub(super) fn is_calm(&self, now: Instant) -> bool {
        self.passing_alarm_at.is_none_or(|at| now - at >= ALARM_OVER)
    }

    /// Records the torque of the servo; `None` without power, or while an alarm switches its motor off. `may_miss_orders` is true
    /// if frames may be lost or reads may stay unanswered.
    pub(super) fn observe(&mut self, now: Instant, torque: Option<Torque>, may_miss_orders: bool) {
        let is_on = torque == Some(Torque::On);
        self.lacks_order = !is_on && (self.lacks_order || may_miss_orders);
        if self.is_on && !is_on {
            self.lost_at = Some(now);
        }
        if std::mem::replace(&mut self.has_power, torque.is_some()) && torque.is_none() {
            self.unpowered_at = Some(now);
            // A servo that restarts begins without an alarm, and its joint engages at once (D28). If an alarm switched the motor
            // off, the next answer shows it again.
            self.passing_alarm_at = None;
        }
        if !is_on {
            self.off_at = now;
        }
        self.is_on = is_on;
    }

    /// Records the position of the servo in counts.
    pub(super) fn stands(&mut self, now: Instant, counts: u16) {
        if counts != self.position.0 {
            self.position = (counts, now);
        }
    }

    /// True if the joint has turned after `then`.
    pub(super) fn has_turned_since(&self, then: Instant) -> bool {
        self.position.1 > then
    }

    /// Records a push that the controller may measure as over the limit. `push` and `limit` are in 0.1 %; `None` without a limit.
    pub(super) fn pushes(&mut self, now: Instant, push: i16, limit: Option<i16>) {
        if limit.is_some_and(|limit| push.saturating_abs().saturating_add(PUSH_ERROR) > limit) {
            self.pushed_at = Some(now);
        }
    }

    /// The last loss of torque in this motor state.
    pub(super) const fn lost_at(&self) -> Option<Instant> {
        self.lost_at
    }

    /// True if the joint may have been let go less than [`ENGAGE_TIME`] ago: the controller need not have given torque again (D28).
    pub(super) fn may_wait_for_torque(&self, now: Instant) -> bool {
        self.lost_at.max(self.alarm_at).max(self.unpowered_at).is_some_and(|at| now - at < ENGAGE_TIME)
    }

    /// True if the controller may take the joint for let go (D28). The joint has an alarm, it lost its torque or power, an alarm
    /// kept it from getting torque, or the torque command may be lost.
    pub(super) fn may_be_let_go(&self, now: Instant) -> bool {
        let has_alarm = self.alarm_at.is_some_and(|at| now - at < NOTICE_TIME);
        let had_cause = self.lost_at.max(self.alarm_at).max(self.unpowered_at).is_some();
        has_alarm || self.lacks_order || had_cause && now - self.off_at < NOTICE_TIME
    }

    /// True for [`GIVE_WAY_TIME`] after a push that may count as over the limit: the set-point may give way (D27).
    pub(super) fn may_give_way(&self, now: Instant) -> bool {
        self.pushed_at.is_some_and(|at| now - at < GIVE_WAY_TIME)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ON: Option<Torque> = Some(Torque::On);
    const OFF: Option<Torque> = Some(Torque::Damping);

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn a_joint_may_be_let_go_after_it_lost_its_torque_and_a_while_longer() {
        let mut truth = JointTruth::default();
        truth.observe(at(0), OFF, false);
        assert!(!truth.may_be_let_go(at(0)) && !truth.may_wait_for_torque(at(0)), "it had no torque yet");
        truth.observe(at(100), ON, false);
        truth.observe(at(200), OFF, false);
        assert_eq!(truth.lost_at(), Some(at(200)));
        assert!(truth.may_wait_for_torque(at(10_199)) && !truth.may_wait_for_torque(at(10_200)));
        truth.observe(at(20_000), OFF, false);
        assert!(truth.may_be_let_go(at(27_499)) && !truth.may_be_let_go(at(27_500)));
    }

    #[test]
    fn a_joint_that_restarts_before_it_had_torque_may_be_let_go() {
        let mut truth = JointTruth::default();
        truth.observe(at(0), None, false);
        truth.observe(at(100), OFF, false);
        assert!(!truth.may_be_let_go(at(100)), "it had no power yet");
        truth.observe(at(200), None, false);
        truth.observe(at(500), OFF, false);
        assert!(truth.may_be_let_go(at(500)) && truth.may_wait_for_torque(at(10_199)));
        assert!(!truth.may_wait_for_torque(at(10_200)) && truth.lost_at().is_none());
    }

    #[test]
    fn a_joint_whose_order_may_be_lost_may_be_let_go_until_it_has_torque() {
        let mut truth = JointTruth::default();
        truth.observe(at(0), OFF, true);
        truth.observe(at(60_000), OFF, false);
        assert!(truth.may_be_let_go(at(60_000)), "only the host can order it again");
        truth.observe(at(60_100), ON, true);
        assert!(!truth.may_be_let_go(at(60_100)));
    }

    #[test]
    fn a_joint_with_an_alarm_may_be_let_go() {
        let mut truth = JointTruth::default();
        truth.observe(at(0), ON, false);
        assert!(!truth.may_be_let_go(at(0)));
        truth.reports(at(0), StatusFields { celsius: 79, ..StatusFields::default() });
        assert!(!truth.may_be_let_go(at(0)), "it is warm");
        truth.reports(
            at(400),
            StatusFields { celsius: 81, alarms: error::OVERHEAT, ..StatusFields::default() },
        );
        truth.reports(at(1_000), StatusFields { celsius: 76, ..StatusFields::default() });
        truth.reports(at(1_100), StatusFields { celsius: 75, ..StatusFields::default() });
        assert!(truth.may_be_let_go(at(8_499)) && !truth.may_be_let_go(at(8_500)));
        assert!(truth.may_wait_for_torque(at(10_999)) && !truth.may_wait_for_torque(at(11_000)));
    }

    #[test]
    fn a_joint_is_calm_some_time_after_the_last_answer_with_an_alarm_that_ends_by_itself() {
        let mut truth = JointTruth::default();
        let answer = |alarms| StatusFields { alarms, ..StatusFields::default() };
        truth.answers(at(0), answer(error::OVERLOAD));
        assert!(truth.is_calm(at(0)), "it is latched");
        truth.answers(at(100), answer(error::OVERLOAD | error::OVERHEAT));
        truth.answers(at(200), answer(error::OVERLOAD));
        assert!(!truth.is_calm(at(499)) && truth.is_calm(at(500)));
        truth.observe(at(600), OFF, false);
        truth.answers(at(600), answer(error::OVERHEAT));
        truth.observe(at(610), None, false);
        assert!(truth.is_calm(at(610)), "it restarts");
    }

    #[test]
    fn a_joint_that_turned_there_and_back_has_turned() {
        let mut truth = JointTruth::default();
        for (millis, counts) in [(0, 500), (100, 501), (200, 500), (300, 500)] {
            truth.stands(at(millis), counts);
        }
        assert!(truth.has_turned_since(at(199)) && !truth.has_turned_since(at(200)));
    }

    #[test]
    fn a_joint_may_give_way_after_a_push_over_its_limit() {
        let mut truth = JointTruth::default();
        truth.pushes(at(0), 550, Some(700));
        truth.pushes(at(0), 1_000, None);
        assert!(!truth.may_give_way(at(0)));
        truth.pushes(at(100), -551, Some(700));
        assert!(truth.may_give_way(at(7_099)) && !truth.may_give_way(at(7_100)));
    }
}
