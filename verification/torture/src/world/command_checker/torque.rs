//! Torque is switched on only where a joint stands, with the goal that its servo holds, and off only where there is none (D12,
//! D13, D28).

use motion_core::servo_bus::Torque;
use protocol_core::registers::Joint;
use protocol_core::registers::map::{MOTOR_STATE, TARGET_POSITION, motor_state};

use super::position::degree;
use super::{CommandChecker, CommandContext, invalid_frame};
use crate::violation::{Check, Violation, ensure};

impl CommandChecker {
    /// Torque switches are set to the motor state in register 29 (D13).
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

    /// Only a servo that holds no torque is switched off in state servo (D28).
    fn check_torque_off(&mut self, joint: Joint, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        ensure(!context.is_known(joint) || !bus.has_torque(joint), || {
            format!("joint {} holds its torque and is freed in state servo", joint.number())
        })?;
        self.forget(joint);
        self.is_on[joint] = false;
        Ok(())
    }

    /// Torque is switched on where a joint stands, and refreshed where it was read on.
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
        // The goal may be missing in the last frame of goals. What counts is that its servo has it.
        let range = self.ranges[joint]
            .or(self.paused[joint])
            .ok_or_else(|| Violation(format!("joint {number} is given torque without a goal")))?;
        if !Self::is_effectless(joint, range.last_goal, context) {
            self.check_position(joint, range.last_goal, "is given torque", context)?;
        }
        self.check_servo_goal(joint, range.last_goal, context)?;
        self.kept_goals[joint] = None;
        self.is_first[joint] = false;
        self.replies.forget_doubt(joint);
        self.check_held_target(joint, range.last_goal, context)?;
        self.engaged_at[joint] = Some(context.now);
        self.attempts[joint].add(context.now);
        self.engagements += 1;
        Ok(())
    }

    /// True if the servo has torque already, and this goal. It may still be on its way there from an older one.
    fn is_effectless(joint: Joint, goal: u16, context: &CommandContext<'_>) -> bool {
        context.bus.has_torque(joint) && context.bus.servo_goal(joint).abs_diff(goal) <= 1
    }

    /// A servo without torque holds the goal that was sent to it, so that it does not go to an older one with its torque.
    fn check_servo_goal(&self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        let held = bus.servo_goal(joint);
        ensure(!context.is_known(joint) || !bus.is_free(joint) || held.abs_diff(goal) <= 1, || {
            format!("joint {} is given torque with the goal {held} instead of {goal}", joint.number())
        })
    }

    /// The target of a joint that lost its torque since it was last given torque is where it gets torque again, unless the
    /// host wrote one since then.
    fn check_held_target(&self, joint: Joint, goal: u16, context: &CommandContext<'_>) -> Check {
        let bus = context.bus;
        let Some((lost_at, engaged_at)) = bus.truth(joint).lost_at().zip(self.engaged_at[joint]) else {
            return Ok(());
        };
        // Before it lost its torque, the servo may have been silent: a target that came then is taken, too (D12).
        let silent_at = self.servo_lost_at[joint].filter(|at| *at > engaged_at);
        let since = silent_at.map_or(lost_at, |at| at.min(lost_at));
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
