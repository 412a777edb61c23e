//! Checks that no joint moves by itself (D12) or pushes too hard (D27).

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::{Availability, DisturbedBus};
use crate::per_joint::PerJoint;
use crate::violation::Check;
use crate::world::motion_checker::Exemption;
use crate::world::push_rule::Push;

/// The `timely_limit` of a servo timeout of 5 ms, which is half of it. With timeouts of up to 5 ms, the responding servos are
/// read often enough while others are silent.
const SHORT: Duration = Duration::from_micros(2_500);

impl DisturbedBus {
    /// Exempts all joints from the motion check, because the motor state is not servo.
    pub(crate) fn exempt_all_by_state(&mut self, now: Instant) {
        self.motion_checker.exempt_all(now, Exemption::MotorState);
    }

    /// Checks that no joint has moved by itself or pushes too hard. In state servo, records the true state of each joint.
    /// `is_guarded` tells that the controller runs and protects the servos. `limits` are the push limits in 0.1 %; `None` without
    /// protection.
    pub(crate) fn check_motion(
        &mut self,
        now: Instant,
        is_servo: bool,
        is_guarded: bool,
        limits: PerJoint<Option<i16>>,
    ) -> Check {
        // Simulate the joints up to now, because they move while the controller is off, too.
        self.plant.bytes(now, &[]);
        if !is_servo {
            self.truths = PerJoint::default();
        }
        let is_undisturbed = self.is_undisturbed(now);
        let may_limit = is_guarded && is_undisturbed && self.are_read_often(now);
        for joint in Joint::ALL {
            let (availability, push) = (self.availability(joint), self.plant.motor_torque(joint));
            let is_limited = may_limit && availability.has_responded(now);
            self.check_push(now, joint, push, limits[joint].filter(|_| is_limited))?;
            if is_servo {
                let may_miss = !is_undisturbed || availability == Availability::Uncertain;
                self.observe(now, joint, may_miss);
                self.truths[joint].pushes(now, push, limits[joint]);
                if self.truths[joint].may_give_way(now) || self.has_wall[joint] {
                    self.motion_checker.may_recoil(joint, &self.plant);
                }
            }
            let meets_thing = joint.number() == 7 && self.has_thing;
            let meets_any = self.has_push[joint] || self.has_wall[joint] || meets_thing;
            if meets_any || self.plant.load_grams() > 0 {
                self.motion_checker.may_overrun(now, joint);
            }
        }
        self.motion_checker.check(now, is_servo, is_guarded && is_undisturbed, &self.plant)
    }

    /// Updates the truth about a joint from the plant and its last status.
    fn observe(&mut self, now: Instant, joint: Joint, may_miss_orders: bool) {
        let truth = &mut self.truths[joint];
        truth.observe(now, self.plant.torque(joint), may_miss_orders);
        truth.stands(now, self.plant.position_counts(joint));
        truth.reports(now, self.last_status[joint]);
    }

    /// True if an undisturbed controller reads the responding servos often enough to limit their pushes. Each silent servo
    /// costs a timeout: with long timeouts, the other servos are read only a few times a second.
    fn are_read_often(&self, now: Instant) -> bool {
        self.timely_limit <= SHORT
            || Joint::ALL.iter().all(|joint| self.availability(*joint).has_responded(now))
    }

    /// Checks the push of a joint. `limit` is `None` if the controller cannot limit the push now.
    fn check_push(&mut self, now: Instant, joint: Joint, permille: i16, limit: Option<i16>) -> Check {
        let push = Push {
            permille,
            speed: self.plant.load(joint).saturating_sub(permille),
            limit,
            is_overloaded: self.plant.is_overloaded(joint),
        };
        self.push_rules[joint].check(now, joint, push)
    }
}
