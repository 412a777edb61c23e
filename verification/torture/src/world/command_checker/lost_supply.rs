//! The arm finds its supply lost only when it is (D29).

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::CommandChecker;
use crate::violation::{Check, ensure};
use crate::world::disturbed_bus::{Availability, DisturbedBus};

/// A servo that has responded for this long has shown its torque.
const ANSWERS_AFTER: Duration = Duration::from_millis(3_000);

impl CommandChecker {
    /// The arm finds its supply lost only after its driven servos were silent, and while none answers with torque (D29).
    pub(in super::super) fn check_lost_supply(&self, now: Instant, bus: &DisturbedBus) -> Check {
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
