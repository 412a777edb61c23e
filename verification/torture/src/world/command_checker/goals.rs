//! Checks that goals are within reach of the last ones, end at the target and keep the linkage. A servo without torque gets a
//! goal only at its position. After a silence, a servo gets a goal only once its torque was read (D10, D12, D25, D27, D29).

use protocol_core::registers::Joint;
use protocol_core::registers::map::{
    LIMITS, MOTOR_STATE, MOVING_JOINTS, SPEED, TARGET_POSITION, limit, motor_state,
};

use super::position::degree;
use super::{CommandChecker, CommandContext, invalid_frame};
use crate::per_joint::PerJoint;
use crate::violation::{Check, Violation, ensure};
use crate::world::reachable_range::ReachableRange;

impl CommandChecker {
    pub(super) fn check_goals(&mut self, items: &[u8], context: &CommandContext<'_>) -> Check {
        let state = context.registers.get(MOTOR_STATE.address);
        ensure(state == motor_state::SERVO, || format!("goals are sent in motor state {state}"))?;
        let mut has_goal = PerJoint::all(false);
        for item in items.chunks(7) {
            let &[id, high, low, ref rest @ ..] = item else { return Err(invalid_frame(items)) };
            let Some(joint) = Joint::from_index(id) else { return Err(invalid_frame(items)) };
            ensure(*rest == [0, 10, 0, 0], || {
                format!("time and speed of joint {}: {rest:?}", joint.number())
            })?;
            has_goal[joint] = true;
            self.goal_at[joint] = context.now;
            self.check_responding(joint, "is driven", context)?;
            self.check_goal(joint, u16::from_be_bytes([high, low]), context)?;
            self.replies.goal_is_sent(joint);
        }
        for joint in Joint::ALL.into_iter().filter(|joint| !has_goal[*joint]) {
            self.paused[joint] = self.ranges[joint].take().or(self.paused[joint]);
            self.paused_at[joint] = context.now;
        }
        self.check_linkage(context)
    }

    /// Checks that the goals of joints 2 and 3 keep the linkage while that limit is on (D25). A joint that gives way may leave
    /// it (D27).
    fn check_linkage(&mut self, context: &CommandContext<'_>) -> Check {
        let [_, two, three, ..] = Joint::ALL;
        let gives_way = |joint| context.bus.truth(joint).may_give_way(context.now);
        let is_off = context.registers.get(LIMITS.address) & limit::LINKAGE == 0;
        if is_off || gives_way(two) || gives_way(three) {
            self.linkage.reset();
            return Ok(());
        }
        let offset = |joint| context.model.offset(joint);
        let goal = |joint| self.ranges[joint].map(|range: ReachableRange| range.last_goal);
        self.linkage.check([goal(two), goal(three)], [offset(two), offset(three)])
    }

    fn check_goal(&mut self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        let speed = context.registers.get(SPEED.of(joint));
        let ahead = self.replies.take_trusted_time(joint, context.now, self.ahead_time);
        let paused = self.paused[joint].take().map(|range| range.resumed(context.now, ahead));
        let before = self.ranges[joint].or(paused);
        let reached = before.and_then(|range| range.after(joint, goal, speed, context.now));
        let new = ReachableRange::at(joint, goal, speed, context.now);
        // A joint without torque engages anew at its position: its goal does not continue the last motion.
        let is_engaging = !self.is_on[joint] || self.replies.was_read_off(joint);
        let goes_on = reached.filter(|_| paused.is_none() && !is_engaging);
        if goes_on.is_none() {
            self.linkage.reset();
        }
        self.ranges[joint] = goes_on.or(Some(new));
        self.check_doubt(joint, goal, context)?;
        match before {
            _ if reached.is_some() => check_arrival(joint, goal, context),
            Some(before) if self.gives_way(joint, before, goal, context) => {
                check_arrival(joint, goal, context)
            }
            Some(before) if paused.is_none() && !is_engaging => Err(Violation(format!(
                "joint {} gets the goal {goal} after {}, out of reach with speed {speed}",
                joint.number(),
                before.last_goal
            ))),
            _ => self.check_position(joint, goal, "is driven", context),
        }
    }

    /// Checks that a servo without torque gets a goal only at its position, and that its torque was read since the last
    /// unanswered read (D29).
    fn check_doubt(&self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        if !context.bus.is_undisturbed(context.now) {
            return Ok(());
        }
        ensure(!self.replies.is_doubtful(joint), || {
            format!("joint {} gets a goal, but its torque was not read after a silence", joint.number())
        })?;
        if context.bus.is_free(joint) {
            return self.check_position(joint, goal, "gets a goal without torque", context);
        }
        Ok(())
    }

    /// True if this goal brings the set-point of a joint that pushes too hard nearer to the measured position (D27).
    fn gives_way(
        &self,
        joint: Joint,
        before: ReachableRange,
        goal: u16,
        context: &CommandContext<'_>,
    ) -> bool {
        let speed = context.registers.get(SPEED.of(joint));
        let reached = |position| before.giving_way(position).after(joint, goal, speed, context.now).is_some();
        let is_nearer = self.replies.positions(joint).any(reached);
        is_nearer && context.bus.truth(joint).may_give_way(context.now)
    }
}

/// Checks that the goal of a joint that has arrived is its target. A target that the arm set itself is rounded to degrees
/// and limited to 0..=180.
fn check_arrival(joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
    if context.registers.get(MOVING_JOINTS.address) & joint.bit() != 0 {
        return Ok(());
    }
    let target = context.registers.get(TARGET_POSITION.of(joint));
    let tolerance = match (context.model.has_host_target[joint], target) {
        (true, _) => 1,
        (false, 0 | 180) => return Ok(()),
        (false, _) => degree(joint) / 2 + 1,
    };
    let wanted = context.model.target_counts(joint, context.registers);
    ensure(goal.abs_diff(wanted) <= tolerance, || {
        format!(
            "joint {} has arrived at {target} degrees ({wanted} counts), but its goal is {goal}",
            joint.number()
        )
    })
}

#[cfg(test)]
mod tests {
    use arm_sim::servo::ServoFault;

    use super::*;
    use crate::world::scripted_arm::ScriptedArm;

    const JOINT: Joint = Joint::ALL[0];

    fn says(check: &Check, what: &str) -> bool {
        matches!(check, Err(Violation(text)) if text.contains(what))
    }

    /// An arm whose joint is engaged, with its goal.
    fn engaged() -> (ScriptedArm, u16) {
        let arm = ScriptedArm::with_engaged(JOINT);
        let goal = arm.bus.position(JOINT);
        (arm, goal)
    }

    #[test]
    fn a_goal_out_of_reach_is_a_violation() {
        let (mut arm, goal) = engaged();
        arm.registers.set(SPEED.of(JOINT), 1);
        assert_eq!(arm.goal(JOINT, goal), Ok(()));
        assert!(says(&arm.goal(JOINT, goal + 10), "out of reach with speed 1"));
    }

    #[test]
    fn a_joint_without_torque_may_engage_where_it_is_measured_anew() {
        for has_torque in [false, true] {
            let mut arm = ScriptedArm::started();
            arm.registers.set(SPEED.of(JOINT), 1);
            arm.ask(JOINT).unwrap();
            let position = arm.bus.position(JOINT);
            if has_torque {
                arm.engage(JOINT).unwrap();
            } else {
                arm.goal(JOINT, position).unwrap();
            }
            arm.bus.turn_by_hand(arm.now, JOINT, position + 30);
            arm.ask_for_reading(JOINT).unwrap();
            assert_eq!(arm.goal(JOINT, position + 30).is_ok(), !has_torque, "torque: {has_torque}");
        }
        let mut arm = ScriptedArm::started();
        arm.ask(JOINT).unwrap();
        let position = arm.bus.position(JOINT);
        assert!(says(&arm.goal(JOINT, position + 30), "gets a goal without torque at"));
    }

    #[test]
    fn a_joint_that_pushes_too_hard_may_give_way_at_any_speed_but_only_towards_its_position() {
        for (limit, towards, is_right) in
            [(None, true, false), (Some(200), true, true), (Some(200), false, false)]
        {
            let (mut arm, goal) = engaged();
            arm.registers.set(SPEED.of(JOINT), 1);
            arm.registers.set(MOVING_JOINTS.address, JOINT.bit());
            arm.push_limit = limit;
            arm.bus.push(arm.now, JOINT, 1_200);
            for _ in 0..20 {
                arm.goal(JOINT, goal).unwrap();
                arm.ask(JOINT).unwrap();
            }
            let position = arm.bus.position(JOINT);
            assert!(position.abs_diff(goal) > 4, "pushed from {goal} to {position}");
            let next = if towards { position } else { 2 * goal - position };
            assert_eq!(arm.goal(JOINT, next).is_ok(), is_right, "limit {limit:?}, towards {towards}");
        }
    }

    #[test]
    fn after_a_silence_the_torque_is_read_before_the_next_goal() {
        let (mut arm, goal) = engaged();
        arm.run(600).unwrap();
        arm.goal(JOINT, goal).unwrap();
        arm.ask(JOINT).unwrap();
        arm.bus.set_fault(arm.now, JOINT, Some(ServoFault::Garbled(1)));
        arm.ask(JOINT).unwrap();
        arm.ask(JOINT).unwrap();
        arm.bus.set_fault(arm.now, JOINT, None);
        arm.ask_for_reading(JOINT).unwrap();
        assert!(says(&arm.goal(JOINT, goal), "was not read after a silence"));
        arm.ask(JOINT).unwrap();
        assert_eq!(arm.goal(JOINT, goal), Ok(()));
    }

    #[test]
    fn goals_are_sent_only_in_state_servo() {
        let (mut arm, goal) = engaged();
        arm.registers.set(MOTOR_STATE.address, motor_state::DAMPING);
        assert!(says(&arm.goal(JOINT, goal), "in motor state 0"));
    }
}
