//! Checks the status of one joint: missing, moving, let go, its torque and its position.

use motion_core::calibration::angle_from_counts;
use motion_core::servo_bus::frame::error;
use protocol_core::registers::Joint;
use protocol_core::registers::map::{LIMITS, MISSING_SERVOS, MOVING_JOINTS, PRESENT_POSITION, limit};
use protocol_core::time::Duration;

use super::context::StatusContext;
use super::move_time::{WHOLE_RANGE, rest_by};
use super::{CHECK_PERIOD, DETECTION_TIME, StatusChecker};
use crate::violation::{Check, ensure};
use crate::world::disturbed_bus::Availability;
use crate::world::extended_model;
use crate::world::joint_truth::COOL;
use crate::world::protection_model::PROTECTION;

/// A joint may have moved away and back if its position was not checked for longer than this: two check periods.
const UNCHECKED_TIME: Duration = Duration::from_millis(500);
/// Torque is off at the latest this long after the motor state changed from servo to another.
const RELEASE_TIME: Duration = Duration::from_millis(300);
/// More than the 114 s of joints 2 and 3 over the whole range of their servos at the lowest speed, 1.9 degrees/s.
const LONGEST_MOVE: Duration = Duration::from_millis(125_000);

impl StatusChecker {
    pub(super) fn check_joint(&mut self, joint: Joint, context: &StatusContext<'_>) -> Check {
        let (number, now) = (joint.number(), context.now);
        let is_missing = context.registers.get(MISSING_SERVOS.address) & joint.bit() != 0;
        let is_moving = context.registers.get(MOVING_JOINTS.address) & joint.bit() != 0;
        match context.bus.availability(joint) {
            Availability::Silent(since) if self.settled_time(now, since) > DETECTION_TIME => {
                ensure(is_missing, || format!("servo {number} is silent and not reported as missing"))?;
            }
            Availability::Responding(since) if self.settled_time(now, since) > DETECTION_TIME => {
                ensure(!is_missing, || format!("servo {number} responds and is reported as missing"))?;
                self.check_position(joint, context)?;
                self.check_torque(joint, context)?;
            }
            _ => {}
        }
        self.check_latch(joint, context)?;
        // A joint of the linkage may wait for the other one (D25), even for one whose servo is missing.
        let may_wait =
            context.model.get(LIMITS.address) & limit::LINKAGE != 0 && matches!(joint.number(), 2 | 3);
        if may_wait {
            // The joint has its full time once the limit is off.
            self.settled_by[joint] = self.settled_by[joint].max(now + LONGEST_MOVE);
        }
        if context.may_be_late(joint) {
            let by = rest_by(now, joint, WHOLE_RANGE, context.registers, context.model);
            self.settled_by[joint] = self.settled_by[joint].max(by);
        }
        let is_late = is_moving && now > self.settled_by[joint];
        ensure(!is_late, || format!("joint {number} has been moving for too long"))?;
        ensure(!(is_moving && is_missing), || format!("joint {number} is reported as moving and missing"))?;
        let is_free = context.model.is_servo() || !context.command_checker.is_on(joint);
        ensure(is_free || self.settled_time(now, self.state_at) < RELEASE_TIME, || {
            format!("joint {number} still has torque")
        })
    }

    /// Checks the positions of the extended block, which the arm computed for the present reply (D21).
    pub(crate) fn check_fine_positions(&self, context: &StatusContext<'_>) -> Check {
        extended_model::check_positions(context.registers)?;
        for joint in Joint::ALL.into_iter().filter(|joint| self.is_responding(*joint, context)) {
            let (position, since) = self.last_moves[joint];
            let at_rest = self.settled_time(context.now, since.max(self.motion_at));
            if position == context.bus.position(joint) && at_rest >= DETECTION_TIME {
                let offset = context.model.offset(joint);
                // Since its last reading a joint that meets an obstacle may have moved by a count.
                let read =
                    context.command_checker.measured(joint).filter(|read| read.abs_diff(position) <= 1);
                let shown = read.unwrap_or(position);
                extended_model::check_position(joint, shown, offset, context.registers)?;
            }
        }
        Ok(())
    }

    /// Checks that the position register of a joint at rest holds its position.
    fn check_position(&mut self, joint: Joint, context: &StatusContext<'_>) -> Check {
        let position = context.bus.position(joint);
        let (last, since) = self.last_moves[joint];
        let checked_at = std::mem::replace(&mut self.position_checked_at[joint], context.now);
        // The joint may have moved away and back since the last check.
        let may_have_moved = last != position
            || context.now - checked_at > UNCHECKED_TIME
            || context.bus.truth(joint).has_turned_since(checked_at);
        if may_have_moved {
            self.last_moves[joint] = (position, context.now);
        }
        // The joint may also move after a write.
        if may_have_moved || self.settled_time(context.now, since.max(self.motion_at)) < DETECTION_TIME {
            return Ok(());
        }
        let angle = angle_from_counts(joint, position, context.model.offset(joint)).nearest_degree();
        let shown = context.registers.get(PRESENT_POSITION.of(joint));
        ensure(shown.abs_diff(angle) == 0, || {
            format!("joint {} is at {angle} degrees, and its register holds {shown}", joint.number())
        })
    }

    /// Checks that a joint that is let go gets torque-off, which ends a latched overload (D28).
    fn check_latch(&mut self, joint: Joint, context: &StatusContext<'_>) -> Check {
        // Register 196 is as old as its last read, so a joint that gets no goals counts as let go.
        let is_let_go = context.now - context.command_checker.goal_at[joint] > CHECK_PERIOD;
        let is_due = is_let_go
            && context.model.is_servo()
            && context.model.get(PROTECTION) == 1
            && self.is_responding(joint, context);
        if !is_due || context.bus.last_status(joint).alarms & error::OVERLOAD == 0 {
            self.unlatched_at[joint] = context.now;
        }
        ensure(context.now - self.unlatched_at[joint] < DETECTION_TIME, || {
            format!("joint {} is let go, and its overload stays latched", joint.number())
        })
    }

    /// Checks that a servo that responds has torque in motor state servo.
    fn check_torque(&self, joint: Joint, context: &StatusContext<'_>) -> Check {
        let is_due =
            context.model.is_servo() && self.settled_time(context.now, self.state_at) > DETECTION_TIME;
        let is_on = context.command_checker.is_on(joint);
        let all_respond = || Joint::ALL.into_iter().all(|other| self.is_responding(other, context));
        let may_wait = context.bus.truth(joint).may_wait_for_torque(context.now)
            || context.command_checker.is_exhausted(joint)
            || (context.command_checker.is_undecided() && !all_respond())
            || context.bus.may_be_misread(joint, context.now)
            || context.bus.last_status(joint).alarms != 0
            || context.bus.last_status(joint).celsius > COOL
            || context.model.get(PROTECTION) == 0;
        ensure(is_on || may_wait || !is_due, || {
            format!("servo {} responds and has no torque", joint.number())
        })
    }
}

#[cfg(test)]
mod tests {
    use arm_sim::servo::{ServoFault, Trip};
    use protocol_core::time::Instant;

    use super::*;
    use crate::violation::Violation;
    use crate::world::scripted_arm::ScriptedArm;

    const JOINT: Joint = Joint::ALL[0];

    fn says(check: &Check, what: &str) -> bool {
        matches!(check, Err(Violation(text)) if text.contains(what))
    }

    /// Asks the joint for this many milliseconds, with or without goals, and checks it four times a second.
    fn check(arm: &mut ScriptedArm, checker: &mut StatusChecker, millis: u64, is_driven: bool) -> Check {
        for _ in 0..millis / 250 {
            for _ in 0..25 {
                arm.ask(JOINT)?;
                if is_driven {
                    arm.goal(JOINT, arm.bus.servo_goal(JOINT))?;
                }
                arm.run(if is_driven { 6 } else { 8 })?;
            }
            let angle = angle_from_counts(JOINT, arm.bus.position(JOINT), 0).nearest_degree();
            arm.registers.set(PRESENT_POSITION.of(JOINT), angle);
            checker.check_joint(JOINT, &arm.status())?;
        }
        Ok(())
    }

    #[test]
    fn a_servo_that_responds_has_torque_in_time() {
        let mut engaged = ScriptedArm::with_engaged(JOINT);
        let mut checker = StatusChecker::new(engaged.now);
        assert_eq!(check(&mut engaged, &mut checker, 4_000, true), Ok(()));
        let mut waits = ScriptedArm::started();
        let mut checker = StatusChecker::new(waits.now);
        assert_eq!(check(&mut waits, &mut checker, 2_250, false), Ok(()));
        assert!(says(&check(&mut waits, &mut checker, 1_000, false), "responds and has no torque"));
    }

    #[test]
    fn a_servo_that_lost_its_torque_gets_it_again_in_time_or_never_by_itself() {
        let lose = |arm: &mut ScriptedArm| {
            arm.bus.restart_servo(arm.now, JOINT);
            arm.run(300).unwrap();
            arm.checker.servo_lost(arm.now, JOINT);
        };
        let mut arm = ScriptedArm::with_engaged(JOINT);
        lose(&mut arm);
        let mut checker = StatusChecker::new(arm.now);
        assert_eq!(check(&mut arm, &mut checker, 9_000, false), Ok(()), "it may wait");
        assert!(says(&check(&mut arm, &mut checker, 2_000, false), "responds and has no torque"));
        let mut exhausted = ScriptedArm::started();
        for _ in 0..3 {
            exhausted.engage(JOINT).unwrap();
            lose(&mut exhausted);
        }
        assert!(exhausted.checker.is_exhausted(JOINT));
        let mut checker = StatusChecker::new(exhausted.now);
        assert_eq!(check(&mut exhausted, &mut checker, 15_000, false), Ok(()));
        exhausted.checker.state_written();
        assert!(check(&mut exhausted, &mut checker, 500, false).is_err(), "the host has ordered it");
    }

    #[test]
    fn an_overload_of_a_joint_that_is_let_go_does_not_stay_latched() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        arm.bus.trip(arm.now, JOINT, Trip::Overload);
        let mut checker = StatusChecker::new(arm.now);
        assert_eq!(check(&mut arm, &mut checker, 4_000, true), Ok(()), "it gets goals, so it is not let go");
        assert!(says(&check(&mut arm, &mut checker, 4_000, false), "stays latched"));
    }

    #[test]
    fn a_move_ends_in_time_unless_something_holds_the_joint() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        let mut checker = StatusChecker::new(arm.now);
        arm.run(1_000).unwrap();
        arm.registers.set(MOVING_JOINTS.address, JOINT.bit());
        assert!(says(&check(&mut arm, &mut checker, 1_000, true), "moving for too long"));
        let mut pushes = ScriptedArm::with_engaged(JOINT);
        let mut checker = StatusChecker::new(pushes.now);
        pushes.push_limit = Some(200);
        pushes.bus.push(pushes.now, JOINT, 900);
        pushes.run(1_000).unwrap();
        pushes.registers.set(MOVING_JOINTS.address, JOINT.bit());
        assert_eq!(check(&mut pushes, &mut checker, 1_000, true), Ok(()), "it gives way");
    }

    #[test]
    fn a_silent_servo_is_reported_and_one_that_responds_is_not() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        let mut checker = StatusChecker::new(arm.now);
        arm.registers.set(MISSING_SERVOS.address, JOINT.bit());
        assert!(says(&check(&mut arm, &mut checker, 3_000, false), "responds and is reported as missing"));
        let mut silent = ScriptedArm::with_engaged(JOINT);
        silent.bus.set_fault(silent.now, JOINT, Some(ServoFault::Missing));
        let mut checker = StatusChecker::new(silent.now);
        assert_eq!(check(&mut silent, &mut checker, 2_500, false), Ok(()));
        assert!(says(&check(&mut silent, &mut checker, 500, false), "silent and not reported"));
    }

    #[test]
    fn the_position_of_a_joint_at_rest_is_shown() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        let mut checker = StatusChecker::new(Instant::ZERO);
        assert_eq!(check(&mut arm, &mut checker, 6_000, true), Ok(()));
        arm.registers.set(PRESENT_POSITION.of(JOINT), 7);
        let noticed = checker.check_joint(JOINT, &arm.status());
        assert!(says(&noticed, "its register holds 7"), "{noticed:?}");
    }
}
