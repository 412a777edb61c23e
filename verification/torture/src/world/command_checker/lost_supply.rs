//! Checks when the arm may report a lost supply (D29).

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::CommandChecker;
use crate::violation::{Check, ensure};
use crate::world::disturbed_bus::{Availability, DisturbedBus};

/// The controller has read the torque of a servo that has responded for this long.
const ANSWERS_AFTER: Duration = Duration::from_millis(3_000);

impl CommandChecker {
    /// Checks that the arm reports a lost supply only after a servo was silent, and while no servo answers with torque (D29).
    pub(crate) fn check_lost_supply(&self, now: Instant, bus: &DisturbedBus) -> Check {
        let responding_for = |joint: Joint| match bus.availability(joint) {
            Availability::Responding(since) => now - since,
            Availability::Silent(_) | Availability::Uncertain => Duration::ZERO,
        };
        let was_silent = |joint: Joint| {
            self.replies.was_silent_for_a_second(joint, now) || responding_for(joint) == Duration::ZERO
        };
        let holds = |joint: Joint| {
            let answers = responding_for(joint) > ANSWERS_AFTER && self.replies.is_steady(joint, now);
            answers && bus.has_torque(joint) && !bus.may_be_let_go(joint, now)
        };
        let any_silent = Joint::ALL.into_iter().any(was_silent);
        let holding = Joint::ALL.into_iter().find(|joint| holds(*joint)).map(Joint::number);
        ensure(!bus.is_undisturbed(now) || (any_silent && holding.is_none()), || {
            format!(
                "the supply counts as lost, after a silence: {any_silent}, and joint {holding:?} has torque"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use arm_sim::servo::ServoFault;

    use super::*;
    use crate::world::scripted_arm::ScriptedArm;

    /// Asks all servos for this many milliseconds.
    fn ask_all(arm: &mut ScriptedArm, millis: u64) {
        let until = arm.now + Duration::from_millis(millis);
        while arm.now < until {
            Joint::ALL.into_iter().for_each(|joint| arm.ask(joint).unwrap());
        }
    }

    fn is_allowed(arm: &ScriptedArm) -> bool {
        arm.checker.check_lost_supply(arm.now, &arm.bus).is_ok()
    }

    fn engaged() -> ScriptedArm {
        let mut arm = ScriptedArm::started();
        Joint::ALL.into_iter().for_each(|joint| arm.engage(joint).unwrap());
        ask_all(&mut arm, 4_000);
        arm
    }

    #[test]
    fn the_supply_is_lost_after_a_second_without_answers_and_without_torque() {
        let mut arm = engaged();
        assert!(!is_allowed(&arm), "no servo was silent");
        arm.bus.begin_stop(arm.now);
        ask_all(&mut arm, 1_200);
        arm.bus.end_stop(arm.now);
        ask_all(&mut arm, 800);
        assert!(is_allowed(&arm));
        let mut unplugged = engaged();
        let set_all = |arm: &mut ScriptedArm, fault| {
            Joint::ALL.into_iter().for_each(|joint| arm.bus.set_fault(arm.now, joint, fault));
        };
        set_all(&mut unplugged, Some(ServoFault::Garbled(1)));
        ask_all(&mut unplugged, 1_200);
        set_all(&mut unplugged, None);
        ask_all(&mut unplugged, 2_500);
        assert!(is_allowed(&unplugged), "their torque may not be read yet");
        ask_all(&mut unplugged, 1_000);
        assert!(!is_allowed(&unplugged), "they have torque");
    }
}
