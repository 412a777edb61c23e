//! The temperature of a simulated servo. The heat of its windings grows with the square of the torque, and the temperature
//! follows with a time constant.
//!
//! A servo that is stalled at full duty shows more than 80 degrees after 99 s. A servo that holds 40 % of its stall
//! torque settles at 56 degrees; without the rounding in each update it would be 57. The values are in
//! [`parameters`](crate::parameters).

use crate::parameters::{AMBIENT_MILLIDEGREES, STALL_RISE_MILLIDEGREES, THERMAL_TIME};

/// The temperature is updated once in this many steps: once a second.
const UPDATE_STEPS: u32 = 1_000;
/// The time constant of the temperature, in updates.
const TIME_CONSTANT: u64 = THERMAL_TIME.as_micros() / 1_000_000;
/// The square of the stall torque, in 0.1 %.
const STALL_SQUARE: u64 = 1_000_000;

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Temperature {
    /// In thousandths of a degree Celsius.
    millidegrees: u64,
    /// The sum of the squares of the torques since the last update.
    squares: u64,
    steps: u32,
}

impl Default for Temperature {
    fn default() -> Self {
        Self { millidegrees: AMBIENT_MILLIDEGREES, squares: 0, steps: 0 }
    }
}

impl Temperature {
    /// Number of next steps in which the temperature cannot change.
    pub(super) const fn steps_to_update(self) -> u32 {
        UPDATE_STEPS.saturating_sub(self.steps + 1)
    }

    /// Adds `count` steps with this torque, in 0.1 % of the stall torque. They must not go beyond the next update.
    pub(super) fn steps(&mut self, torque: i16, count: u32) {
        let torque = u64::from(torque.unsigned_abs());
        self.squares += torque * torque * u64::from(count);
        self.steps += count;
        if self.steps < UPDATE_STEPS {
            return;
        }
        let mean = self.squares / u64::from(UPDATE_STEPS);
        let final_value = AMBIENT_MILLIDEGREES + STALL_RISE_MILLIDEGREES * mean / STALL_SQUARE;
        let millidegrees = (self.millidegrees * (TIME_CONSTANT - 1) + final_value) / TIME_CONSTANT;
        *self = Self { millidegrees, squares: 0, steps: 0 };
    }

    /// Sets the temperature, for a forced alarm.
    pub(super) fn set(&mut self, celsius: u8) {
        self.millidegrees = u64::from(celsius) * 1_000;
    }

    pub(super) fn celsius(self) -> u8 {
        u8::try_from(self.millidegrees / 1_000).unwrap_or(u8::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The temperature after this many seconds with this torque.
    fn after(torque: i16, seconds: u32) -> u8 {
        let mut temperature = Temperature::default();
        (0..seconds).for_each(|_| temperature.steps(torque, UPDATE_STEPS));
        temperature.celsius()
    }

    #[test]
    fn a_stalled_servo_overheats_in_minutes_and_one_at_40_percent_never() {
        assert_eq!([after(1_000, 98), after(-1_000, 99)], [80, 81]);
        assert_eq!([after(400, 3_600), after(400, 36_000)], [56, 56]);
        assert_eq!(after(0, 3_600), 25);
    }

    #[test]
    fn it_cools_down() {
        let mut temperature = Temperature::default();
        temperature.set(85);
        (0..300).for_each(|_| temperature.steps(0, UPDATE_STEPS));
        assert_eq!(temperature.celsius(), 46, "60 K above, less a time constant");
    }
}
