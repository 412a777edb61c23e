//! Checks that a joint gets its first goal, and torque, only at its position, and only if its servo answers (D12).

use protocol_core::registers::Joint;
use protocol_core::registers::map::MISSING_SERVOS;
use protocol_core::time::Duration;

use super::{CommandChecker, CommandContext};
use crate::violation::{Check, ensure};

/// The number of reads without a reply after which a servo is silent: three have failed (D12), one may be in progress.
const MAX_UNANSWERED: u8 = 4;
/// The largest age of a reading at which the controller gives torque. The controller reads the joint again before it uses an
/// older reading.
const FRESH_FOR: Duration = Duration::from_millis(20);
/// Counts that a joint without torque may fall during [`FRESH_FOR`], at 130 degrees/s.
const MAX_FALL: u16 = 12;

impl CommandChecker {
    /// Checks that a silent servo gets neither a goal nor torque (D12).
    pub(super) fn check_responding(&self, joint: Joint, what: &str, context: &CommandContext<'_>) -> Check {
        let is_flagged = context.registers.get(MISSING_SERVOS.address) & joint.bit() != 0;
        // On a disturbed bus the controller may decode a reply that this decoder misses.
        let unanswered = self.replies.unanswered(joint);
        let is_silent = unanswered >= MAX_UNANSWERED && context.bus.is_undisturbed(context.now);
        ensure(!is_flagged && !is_silent, || {
            let number = joint.number();
            format!("joint {number} {what} while its servo is silent: {unanswered} reads without a reply")
        })
    }

    /// Checks that a joint starts from its position, or from a near goal that it kept while its servo was lost or the
    /// controller restarted (D12).
    pub(super) fn check_position(
        &self,
        joint: Joint,
        goal: u16,
        what: &str,
        context: &CommandContext<'_>,
    ) -> Check {
        let bus = context.bus;
        let held = self.held_goal(joint).map(|held| (held, 1));
        let is_at = |(kept, tolerance): (u16, u16)| goal.abs_diff(kept) <= tolerance;
        let is_kept = self.kept_goals[joint].into_iter().chain(held).any(is_at);
        let degrees = if is_kept { 4 } else { 1 };
        let fall = if bus.has_torque(joint) { 0 } else { MAX_FALL };
        // The joint may move after its reading, for example to a corrupted goal. The reading itself may be old. The highest
        // speed, 372 degrees/s, is 1,757 counts/s.
        let speed = u64::from(bus.last_status(joint).speed);
        let moved = (bus.reply_age(joint).as_micros() * 1_757 + FRESH_FOR.as_micros() * speed) / 1_000_000;
        let error = bus.position_tolerance(joint, context.now);
        let tolerance = u64::from(degrees * degree(joint) + fall) + moved + error;
        let position = bus.position(joint);
        let is_near =
            u64::from(goal.abs_diff(position)) <= tolerance || bus.may_be_misread(joint, context.now);
        ensure(is_near, || {
            format!("joint {} {what} at {position} counts with the goal {goal}", joint.number())
        })
    }
}

/// The number of counts in a degree, rounded up.
pub(super) fn degree(joint: Joint) -> u16 {
    if joint.number() < 5 { 5 } else { 4 }
}

#[cfg(test)]
mod tests {
    use arm_sim::servo::ServoFault;

    use super::*;
    use crate::violation::Violation;
    use crate::world::scripted_arm::ScriptedArm;

    const JOINT: Joint = Joint::ALL[0];

    #[test]
    fn after_a_restart_of_the_controller_the_goal_of_the_servo_may_be_three_degrees_away() {
        // 3 degrees are 14 counts; 4 degrees are allowed.
        for (turned, kept, is_right) in [(18, true, true), (18, false, true), (25, true, false)] {
            let mut arm = ScriptedArm::with_engaged(JOINT);
            let goal = arm.bus.position(JOINT);
            arm.restart_controller();
            arm.bus.turn_by_hand(arm.now, JOINT, goal + turned);
            arm.ask(JOINT).unwrap();
            let next = if kept { goal } else { goal + turned };
            assert_eq!(arm.goal(JOINT, next).is_ok(), is_right, "turned by {turned}, the old goal: {kept}");
        }
        let mut arm = ScriptedArm::started();
        arm.ask(JOINT).unwrap();
        let position = arm.bus.position(JOINT);
        assert!(arm.goal(JOINT, position - 18).is_err(), "it held no goal");
    }

    #[test]
    fn a_silent_servo_gets_no_goal() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        let goal = arm.bus.position(JOINT);
        arm.run(600).unwrap();
        arm.bus.set_fault(arm.now, JOINT, Some(ServoFault::Garbled(1)));
        (0..4).for_each(|_| arm.ask(JOINT).unwrap());
        let refused = arm.goal(JOINT, goal);
        assert!(matches!(&refused, Err(Violation(text)) if text.contains("4 reads without a reply")));
        let mut flagged = ScriptedArm::with_engaged(JOINT);
        flagged.registers.set(MISSING_SERVOS.address, JOINT.bit());
        assert!(flagged.goal(JOINT, goal).is_err(), "reported as missing");
    }
}
