//! Checks that the arm enters state 0 by itself after a long loss of the servos' supply (D29).

use protocol_core::registers::RegisterFile;
use protocol_core::time::{Duration, Instant};

use super::protection_model::SUPPLY_LOST;
use crate::violation::{Check, ensure};

/// The arm has to enter state 0 after a stop of at least this time. It may enter state 0 once the servos were silent for a second.
const SURELY_LOST: Duration = Duration::from_millis(1_500);
/// The servos start in 0.2 s. The arm notices that they restarted within this time, also on a bus with long timeouts.
const NOTICE_TIME: Duration = Duration::from_millis(2_500);

/// The present emergency stop, while nothing else disturbs the arm.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SupplyRule {
    from: Option<Instant>,
    /// When the arm has to be in state 0.
    due: Option<Instant>,
}

impl SupplyRule {
    /// The supply of an arm whose joints are all driven is cut.
    pub(super) fn stop_begins(&mut self, now: Instant) {
        *self = Self { from: Some(now), due: None };
    }

    /// The supply is back.
    pub(super) fn stop_ends(&mut self, now: Instant) {
        let was_long = self.from.is_some_and(|from| now - from >= SURELY_LOST);
        self.due = was_long.then(|| now + NOTICE_TIME);
    }

    /// Something else disturbs the arm, or register 29 was written.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Checks that the arm entered state 0 if it had to. Returns whether it had to.
    pub(super) fn check(&mut self, now: Instant, registers: &RegisterFile) -> Check<bool> {
        let is_due = self.due.is_some_and(|due| now >= due);
        ensure(!is_due || registers.get(SUPPLY_LOST) == 1, || {
            "the supply was lost and came back, and the arm did not enter state 0".to_owned()
        })?;
        if is_due {
            self.forget();
        }
        Ok(is_due)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    /// The rule after a stop of this length that began at 10 s, checked when the arm has to be in state 0.
    fn check(stop_millis: u64, has_told: bool) -> Check<bool> {
        let mut registers = RegisterFile::new([0; 6], None);
        registers.set(SUPPLY_LOST, u8::from(has_told));
        let mut rule = SupplyRule::default();
        rule.stop_begins(at(10_000));
        let end = at(10_000 + stop_millis);
        rule.stop_ends(end);
        assert!(
            !rule.check(end + Duration::from_micros(NOTICE_TIME.as_micros() - 1), &registers)?,
            "it has some time"
        );
        rule.check(end + NOTICE_TIME, &registers)
    }

    #[test]
    fn an_arm_that_does_not_enter_state_0_after_a_long_stop_breaks_the_rule() {
        assert!(check(1_500, false).is_err());
        assert!(check(1_500, true).unwrap(), "checked");
        assert!(!check(1_499, false).unwrap(), "a short stop: nothing is demanded");
    }
}
