//! Checks that torque is switched on only at the position of a joint, with the goal that its servo holds, and in state servo off
//! only if the servo has no torque (D12, D13, D28).

use motion_core::servo_bus::Torque;
use protocol_core::registers::Joint;
use protocol_core::registers::map::{MOTOR_STATE, TARGET_POSITION, motor_state};
use protocol_core::time::Duration;

use super::position::degree;
use super::{CommandChecker, CommandContext, invalid_frame};
use crate::violation::{Check, Violation, ensure};

/// After this time with torque, the controller has read that the torque of a servo is on.
const HELD_FOR: Duration = Duration::from_millis(1_000);

impl CommandChecker {
    /// Checks that torque switches are set to the motor state in register 29 (D13), or off for a servo without torque (D28).
    pub(super) fn check_torque_switches(&mut self, items: &[u8], context: &CommandContext<'_>) -> Check {
        let state = context.registers.get(MOTOR_STATE.address);
        let torque = match state {
            motor_state::SERVO => Torque::On,
            motor_state::FORCELESS => Torque::Free,
            _ => Torque::Damping,
        };
        for item in items.chunks(2) {
            let [id, code] = *item else { return Err(invalid_frame(items)) };
            let Some(joint) = Joint::from_index(id) else { return Err(invalid_frame(items)) };
            if torque == Torque::On && code == self.codes.code(Torque::Damping) {
                self.check_torque_off(joint, context)?;
                continue;
            }
            ensure(code == self.codes.code(torque), || {
                format!("the torque switch of joint {} is set to {code} in state {state}", joint.number())
            })?;
            if torque == Torque::On {
                self.check_torque_on(joint, context)?;
            }
            self.is_on[joint] = torque == Torque::On;
        }
        Ok(())
    }

    /// Checks that only a servo without torque is switched off in state servo (D28).
    fn check_torque_off(&mut self, joint: Joint, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        ensure(!context.is_known(joint) || !bus.has_torque(joint), || {
            format!("joint {} holds its torque and is freed in state servo", joint.number())
        })?;
        self.forget(joint);
        self.is_on[joint] = false;
        Ok(())
    }

    /// Checks that torque is switched on only at the position of a joint, and refreshed only after it was read as on.
    fn check_torque_on(&mut self, joint: Joint, context: &CommandContext<'_>) -> Check {
        let number = joint.number();
        self.check_responding(joint, "is given torque", context)?;
        let is_fresh = self.replies.take_read_on(joint);
        let is_released = std::mem::take(&mut self.is_released[joint]);
        let is_undisturbed = context.bus.is_undisturbed(context.now);
        let is_engaging = !self.is_on[joint]
            || is_released
            || self.replies.was_read_off(joint)
            || self.replies.was_lost(joint)
            || (context.bus.is_free(joint) && is_undisturbed);
        if !is_engaging {
            return ensure(is_fresh || !is_undisturbed, || {
                format!("the torque of joint {number} is refreshed, but was not read on since the last time")
            });
        }
        // The last frame of goals may have none for this joint. The servo holds its last goal.
        let range = self.ranges[joint]
            .or(self.paused[joint])
            .ok_or_else(|| Violation(format!("joint {number} is given torque without a goal")))?;
        if !Self::is_effectless(joint, range.last_goal, context) {
            self.check_position(joint, range.last_goal, "is given torque", context)?;
        }
        self.check_servo_goal(joint, range.last_goal, context)?;
        self.check_alarm_is_over(joint, context)?;
        self.check_attempts(joint, context)?;
        self.kept_goals[joint] = None;
        self.is_first[joint] = false;
        self.replies.forget_doubt(joint);
        self.check_held_target(joint, range.last_goal, context)?;
        self.engaged_at[joint] = Some(context.now);
        self.attempts[joint].add(context.now);
        self.engagements += 1;
        Ok(())
    }

    /// True if the servo already has torque and this goal, so that the command changes nothing. The servo may still be on its
    /// way to the goal.
    fn is_effectless(joint: Joint, goal: u16, context: &CommandContext<'_>) -> bool {
        context.bus.has_torque(joint) && context.bus.servo_goal(joint).abs_diff(goal) <= 1
    }

    /// Checks that a servo without torque holds the last goal that was sent to it. Otherwise torque would drive it to an older
    /// goal.
    fn check_servo_goal(&self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        let held = bus.servo_goal(joint);
        ensure(!context.is_known(joint) || !bus.is_free(joint) || held.abs_diff(goal) <= 1, || {
            format!("joint {} is given torque with the goal {held} instead of {goal}", joint.number())
        })
    }

    /// Checks that a joint that was let go engages only when its alarm has been gone for a while (D28). If it was let go soon
    /// after it was given torque, the controller may assume that the torque command was lost.
    fn check_alarm_is_over(&self, joint: Joint, context: &CommandContext<'_>) -> Check {
        let truth = context.bus.truth(joint);
        // A joint that has not turned since it lost its torque counts as held, and is driven on after a silence.
        let was_held =
            self.was_silent(joint) && truth.lost_at().is_some_and(|at| !truth.has_turned_since(at));
        ensure(truth.is_calm(context.now) || was_held || !self.was_let_go(joint, context), || {
            format!("joint {} is given torque before its alarm is over", joint.number())
        })
    }

    /// Checks that a joint that was let go engages at most three times in a minute, unless register 29 is written (D28). A test
    /// of motion-core checks that the joint waits for the host after the third time, also after the minute.
    fn check_attempts(&mut self, joint: Joint, context: &CommandContext<'_>) -> Check {
        // The servo of a joint that fell silent may have restarted unnoticed. Such a joint is not let go.
        if self.was_silent(joint) || !self.was_let_go(joint, context) {
            return Ok(());
        }
        ensure(!self.attempts[joint].add_after_let_go(context.now), || {
            format!("joint {} was let go and is given torque for the fourth time in a minute", joint.number())
        })
    }

    /// True if the servo of the joint fell silent since the joint was last given torque.
    fn was_silent(&self, joint: Joint) -> bool {
        self.servo_lost_at[joint] > self.engaged_at[joint]
    }

    /// True if the joint was let go since it was last given torque, and the controller knows that.
    fn was_let_go(&self, joint: Joint, context: &CommandContext<'_>) -> bool {
        let times = context.bus.truth(joint).lost_at().zip(self.engaged_at[joint]);
        times.is_some_and(|(lost, engaged)| lost > engaged + HELD_FOR) && context.is_known(joint)
    }

    /// Checks that a joint that lost its torque gets torque again at its target, unless the host wrote the target since the
    /// loss. A joint may lose its torque twice before the controller gives it torque: a hot servo may hold its goal again by
    /// itself, and then restart.
    fn check_held_target(&self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        let Some((lost_at, engaged_at)) = bus.truth(joint).lost_at().zip(self.engaged_at[joint]) else {
            return Ok(());
        };
        // The servo may have been silent before it lost its torque. A target written during the silence counts, too (D12).
        let silent_at = self.servo_lost_at[joint].filter(|at| *at > engaged_at);
        let since = silent_at.map_or(lost_at, |at| at.min(lost_at));
        let since = if self.is_written_for_later[joint] { engaged_at } else { since };
        let is_written = self.target_written_at[joint].is_some_and(|at| at >= since);
        let target = context.registers.get(TARGET_POSITION.of(joint));
        if lost_at < engaged_at || is_written || !context.is_known(joint) || matches!(target, 0 | 180) {
            return Ok(());
        }
        let wanted = context.model.target_counts(joint, context.registers);
        ensure(goal.abs_diff(wanted) <= degree(joint) / 2 + 1, || {
            format!(
                "joint {} gets torque again at {goal} counts, and its target is {target} degrees ({wanted} counts)",
                joint.number()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use arm_sim::servo::Trip;
    use protocol_core::registers::map::MOVING_JOINTS;

    use super::*;
    use crate::world::scripted_arm::ScriptedArm;

    const JOINT: Joint = Joint::ALL[0];

    /// An arm whose joint has its goal, and no torque yet.
    fn with_goal() -> ScriptedArm {
        let mut arm = ScriptedArm::started();
        arm.ask(JOINT).unwrap();
        let position = arm.bus.position(JOINT);
        arm.goal(JOINT, position).unwrap();
        arm.ask(JOINT).unwrap();
        arm
    }

    fn says<T: std::fmt::Debug>(check: &Check<T>, what: &str) -> bool {
        matches!(check, Err(Violation(text)) if text.contains(what))
    }

    #[test]
    fn torque_goes_only_where_the_joint_stands_with_a_goal() {
        assert_eq!(with_goal().torque(JOINT, Torque::On), Ok(()));
        let mut without_goal = ScriptedArm::started();
        without_goal.ask(JOINT).unwrap();
        assert!(says(&without_goal.torque(JOINT, Torque::On), "without a goal"));
        let mut elsewhere = with_goal();
        let position = elsewhere.bus.position(JOINT);
        elsewhere.bus.turn_by_hand(elsewhere.now, JOINT, position + 30);
        assert!(says(&elsewhere.torque(JOINT, Torque::On), "is given torque at"));
    }

    #[test]
    fn torque_for_a_servo_that_has_it_and_this_goal_changes_nothing() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        let goal = arm.bus.position(JOINT);
        // The servo was silent, and something has turned the joint.
        arm.checker.servo_lost(arm.now, JOINT);
        arm.ask(JOINT).unwrap();
        arm.goal(JOINT, goal).unwrap();
        arm.bus.turn_by_hand(arm.now, JOINT, goal + 30);
        assert_eq!(arm.torque(JOINT, Torque::On), Ok(()));
        let mut freed = with_goal();
        freed.bus.turn_by_hand(freed.now, JOINT, goal + 30);
        assert!(says(&freed.torque(JOINT, Torque::On), "is given torque at"), "without torque it counts");
    }

    #[test]
    fn torque_is_refreshed_only_if_it_was_read_on() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        assert_eq!(arm.torque(JOINT, Torque::On), Ok(()));
        arm.ask_for_reading(JOINT).unwrap();
        assert!(says(&arm.torque(JOINT, Torque::On), "was not read on"));
    }

    #[test]
    fn torque_off_in_state_servo_goes_only_to_a_servo_without_torque() {
        let mut arm = ScriptedArm::with_engaged(JOINT);
        // A second after the start of the bus its state is known.
        assert!(says(&arm.torque(JOINT, Torque::Damping), "holds its torque and is freed"));
        assert!(says(&arm.torque(JOINT, Torque::Free), "in state 1"));
        arm.bus.restart_servo(arm.now, JOINT);
        arm.run(300).unwrap();
        assert_eq!(arm.torque(JOINT, Torque::Damping), Ok(()));
    }

    #[test]
    fn a_joint_that_heat_freed_gets_no_torque_before_the_alarm_is_over() {
        for (is_hot, is_right) in [(false, true), (true, false)] {
            let mut arm = ScriptedArm::with_engaged(JOINT);
            arm.run(1_500).unwrap();
            if is_hot {
                arm.bus.trip(arm.now, JOINT, Trip::Heat);
            } else {
                arm.bus.restart_servo(arm.now, JOINT);
            }
            arm.run(300).unwrap();
            arm.torque(JOINT, Torque::Damping).unwrap();
            let check = arm.engage(JOINT);
            assert_eq!(check.is_ok(), is_right, "{check:?}");
            assert_eq!(says(&check, "before its alarm is over"), is_hot, "{check:?}");
        }
    }

    #[test]
    fn a_joint_gets_torque_again_where_its_target_is_unless_the_host_wrote_one() {
        let written = |is_let_go| Some(is_let_go);
        for (target, before, after, is_right) in [
            (90, None, None, true),
            (120, None, None, false),
            (120, None, written(true), true),
            (120, None, written(false), true),
            (120, written(false), None, false),
            (120, written(true), None, true),
        ] {
            let mut arm = ScriptedArm::with_engaged(JOINT);
            arm.run(1_000).unwrap();
            let write = |arm: &mut ScriptedArm, is_let_go: Option<bool>| {
                if let Some(is_let_go) = is_let_go {
                    arm.checker.target_written(arm.now, JOINT, is_let_go);
                    arm.registers.set(MOVING_JOINTS.address, JOINT.bit());
                }
            };
            write(&mut arm, before);
            arm.run(10).unwrap();
            arm.bus.restart_servo(arm.now, JOINT);
            arm.run(300).unwrap();
            arm.registers.set(TARGET_POSITION.of(JOINT), target);
            write(&mut arm, after);
            let check = arm.engage(JOINT);
            assert_eq!(check.is_ok(), is_right, "target {target}, {before:?}, {after:?}: {check:?}");
        }
    }
}
