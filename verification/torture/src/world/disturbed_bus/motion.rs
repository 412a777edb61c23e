//! Checks what the joints do: that none moves by itself (D12) or pushes too hard (D27).

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::{Availability, DisturbedBus};
use crate::per_joint::PerJoint;
use crate::violation::Check;
use crate::world::motion_checker::Exemption;
use crate::world::push_rule::Push;

/// Half of a servo timeout with which silent servos do not delay the readings of the others.
const SHORT: Duration = Duration::from_micros(2_500);

impl DisturbedBus {
    /// Exempts all joints from the motion check: the motor state is not servo.
    pub(crate) fn exempt_all_by_state(&mut self, now: Instant) {
        self.motion_checker.exempt_all(now, Exemption::MotorState);
    }

    /// Checks that no joint has moved by itself. `is_guarded` tells that the controller runs and protects the servos.
    /// `limits` are those of the pushes in 0.1 %; `None` without protection.
    pub(crate) fn check_motion(
        &mut self,
        now: Instant,
        is_servo: bool,
        is_guarded: bool,
        limits: PerJoint<Option<i16>>,
    ) -> Check {
        // The joints move while the controller is off, too.
        self.plant.bytes(now, &[]);
        if !is_servo {
            self.truths = PerJoint::default();
        }
        let is_undisturbed = self.is_undisturbed(now);
        let limited =
            if is_guarded && is_undisturbed { self.limited_joints(now) } else { PerJoint::default() };
        for joint in Joint::ALL {
            self.check_push(now, joint, limits[joint].filter(|_| limited[joint]))?;
        }
        for joint in Joint::ALL.into_iter().filter(|_| is_servo) {
            let may_miss = !is_undisturbed || self.availability(joint) == Availability::Uncertain;
            self.truths[joint].observe(now, self.plant.torque(joint), may_miss);
            self.truths[joint].stands(now, self.plant.position_counts(joint));
            self.truths[joint].pushes(now, self.plant.motor_torque(joint), limits[joint]);
            self.truths[joint].reports(now, self.last_status[joint]);
            if self.truths[joint].may_give_way(now) || self.has_wall[joint] {
                self.motion_checker.may_recoil(joint, &self.plant);
            }
        }
        for joint in Joint::ALL {
            let meets_thing = joint.number() == 7 && self.has_thing;
            let meets_any = self.has_push[joint] || self.has_wall[joint] || meets_thing;
            if meets_any || self.plant.load_grams() > 0 {
                self.motion_checker.may_overrun(now, joint);
            }
        }
        self.motion_checker.check(now, is_servo, is_guarded && is_undisturbed, &self.plant)
    }

    /// The joints whose push a controller can limit that is not disturbed.
    fn limited_joints(&self, now: Instant) -> PerJoint<bool> {
        let responds =
            |joint| matches!(self.availability(joint), Availability::Responding(since) if now >= since);
        let responding = PerJoint(Joint::ALL.map(responds));
        // Each silent servo costs a timeout: with long ones the others are read a few times a second.
        let is_read_often = self.timely_limit <= SHORT || responding == PerJoint::all(true);
        if is_read_often { responding } else { PerJoint::default() }
    }

    /// Checks the push of a joint. `limit` is what the controller keeps, if it can.
    fn check_push(&mut self, now: Instant, joint: Joint, limit: Option<i16>) -> Check {
        let push = Push {
            permille: self.plant.motor_torque(joint),
            speed: self.plant.load(joint).saturating_sub(self.plant.motor_torque(joint)),
            limit,
            is_overloaded: self.plant.is_overloaded(joint),
        };
        self.push_rules[joint].check(now, joint, push)
    }
}
