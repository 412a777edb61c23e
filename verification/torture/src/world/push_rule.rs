//! Checks that no servo's own overload protection acts while the controller limits its push, and that no push over
//! the limit lasts (D27).
//!
//! The rule binds while the controller can limit: the servo responds, the bus is undisturbed, the shell runs, and the limit
//! is at most 75 %.

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use crate::violation::{Check, ensure};

/// Up to this limit in 0.1 % of the stall torque no servo switches itself off (D27).
const HIGHEST_LIMIT: i16 = 750;
/// The rule binds after the controller has been able to limit for this time.
const ABLE_FOR: Duration = Duration::from_millis(2_500);
/// A push over the limit ends within this time, on a bus with long timeouts, too.
const LASTS_FOR: Duration = Duration::from_millis(1_000);
/// A push counts from this much over its limit, in 0.1 %: 5 % are allowed (D27), and the average of 100 ms ripples.
const TOLERANCE: i16 = 150;

/// A joint that is turned against its push faster than this already gives way. In 0.1 % of the highest speed: 15 degrees/s.
const GIVES_WAY: i16 = 40;

/// The true push and speed of a joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Push {
    /// The push in 0.1 % of the stall torque.
    pub(super) permille: i16,
    /// The speed in 0.1 % of the highest speed. It has the sign of the push if both have the same direction.
    pub(super) speed: i16,
    /// The limit of the push in 0.1 %; `None` if the controller cannot limit it.
    pub(super) limit: Option<i16>,
    /// The servo's overload protection has switched it off.
    pub(super) is_overloaded: bool,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PushRule {
    /// The last time at which the controller could not limit.
    unable_at: Instant,
    /// The last time at which the push was not over its limit.
    low_at: Instant,
    was_overloaded: bool,
}

impl PushRule {
    /// An overload is forced on the servo.
    pub(super) fn overload_is_forced(&mut self) {
        self.was_overloaded = true;
    }

    /// Checks the push and the overload protection of the joint.
    pub(super) fn check(&mut self, now: Instant, joint: Joint, push: Push) -> Check {
        let limit = push.limit.filter(|limit| *limit <= HIGHEST_LIMIT);
        if limit.is_none() {
            self.unable_at = now;
        }
        let was_overloaded = std::mem::replace(&mut self.was_overloaded, push.is_overloaded);
        let has_tripped = push.is_overloaded && !was_overloaded;
        let is_able_for = now - self.unable_at;
        ensure(!has_tripped || is_able_for < ABLE_FOR, || {
            format!("the servo of joint {} protects itself by switching itself off", joint.number())
        })?;
        let gives_way = push.speed.signum() == -push.permille.signum() && push.speed.abs() > GIVES_WAY;
        if gives_way || limit.is_none_or(|limit| push.permille.saturating_abs() <= limit + TOLERANCE) {
            self.low_at = now;
        }
        ensure(now - self.low_at < LASTS_FOR || is_able_for < ABLE_FOR, || {
            format!(
                "joint {} goes on pushing with {} over its limit {limit:?}",
                joint.number(),
                push.permille
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(rule: &mut PushRule, millis: u64, push: Push) -> bool {
        rule.check(Instant::from_micros(millis * 1_000), Joint::ALL[0], push).is_ok()
    }

    #[test]
    fn a_trip_or_a_lasting_push_breaks_the_rule_if_the_controller_can_limit() {
        let push = |permille, limit| Push { permille, speed: 0, limit, is_overloaded: false };
        let tripped = |limit| Push { is_overloaded: true, ..push(0, limit) };
        let mut rule = PushRule::default();
        assert!(check(&mut rule, 3_000, push(700, Some(700))));
        assert!(!check(&mut rule.clone(), 3_100, tripped(Some(700))));
        assert!(check(&mut rule.clone(), 3_999, push(-900, Some(700))));
        assert!(!check(&mut rule.clone(), 4_001, push(-900, Some(700))));
        rule.overload_is_forced();
        assert!(check(&mut rule, 3_200, tripped(None)) && check(&mut rule, 3_300, push(0, Some(700))));
        assert!(check(&mut rule, 3_400, tripped(Some(700))), "the controller could not limit before");
        rule.overload_is_forced();
        assert!(check(&mut rule, 9_000, tripped(Some(700))), "forced");
        assert!(check(&mut rule, 9_100, push(0, Some(700))), "it is over");
        assert!(!check(&mut rule, 9_200, tripped(Some(700))), "the next one is not forced");
    }
}
