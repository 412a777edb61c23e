//! A servo at rest. Its steps change only sums and counts, so they are simulated at once when the rest ends.

use protocol_core::time::Instant;

use crate::servo::Servo;
use crate::servo::units::STEP;

/// The next steps of a servo that change only its sums and counts, if no call changes the servo.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Rest {
    /// The end of the last step before the rest.
    since: Instant,
    /// The end of the last step of the rest.
    until: Instant,
    /// The supply voltage in these steps.
    decivolts: u8,
}

impl Rest {
    /// The next step may change something.
    pub(super) const NONE: Self = Self { since: Instant::ZERO, until: Instant::ZERO, decivolts: 0 };

    /// The rest of a servo after its step that ended at `now`.
    pub(super) fn after_step(servo: &Servo, now: Instant, decivolts: u8) -> Self {
        Self { since: now, until: servo.rest_until(now, decivolts), decivolts }
    }

    /// The end of the rest at this supply voltage; a time in the past if the servo does not rest at this voltage.
    pub(super) fn until(self, decivolts: u8) -> Instant {
        if decivolts == self.decivolts { self.until } else { Instant::ZERO }
    }

    /// Ends the rest: simulates its steps up to `now`.
    pub(super) fn end(&mut self, servo: &mut Servo, now: Instant) {
        let steps = (now.min(self.until) - self.since).as_micros() / STEP.as_micros();
        if steps > 0 {
            servo.rest(u32::try_from(steps).unwrap_or(u32::MAX));
        }
        *self = Self::NONE;
    }
}
