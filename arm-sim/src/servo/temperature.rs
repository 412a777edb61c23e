//! The temperature of a simulated servo: it follows the load slowly. The figures are assumed.

/// The temperature around the arm, in thousandths of a degree Celsius.
const AMBIENT: u32 = 25_000;
/// The final rise in temperature for each 0.1 % of load, in thousandths of a degree.
const RISE_PER_LOAD: u32 = 40;
/// The temperature is updated once in this many steps: once a second.
const UPDATE_STEPS: u32 = 1_000;
/// The time constant of the temperature, in updates.
const TIME_CONSTANT: u32 = 300;

/// A servo's temperature.
#[derive(Clone, Copy, Debug)]
pub(super) struct Temperature {
    /// In thousandths of a degree Celsius.
    millidegrees: u32,
    /// The sum of the loads since the last update.
    loads: u32,
    steps: u32,
}

impl Default for Temperature {
    fn default() -> Self {
        Self { millidegrees: AMBIENT, loads: 0, steps: 0 }
    }
}

impl Temperature {
    /// How many steps the temperature certainly stays the same.
    pub(super) const fn steps_to_update(self) -> u32 {
        UPDATE_STEPS.saturating_sub(self.steps + 1)
    }

    /// Adds steps with this load, in 0.1 %. Several at once must not be more than [`Temperature::steps_to_update`].
    pub(super) fn steps(&mut self, load: u16, count: u32) {
        self.loads += u32::from(load) * count;
        self.steps += count;
        if self.steps < UPDATE_STEPS {
            return;
        }
        let final_value = AMBIENT + RISE_PER_LOAD * self.loads / UPDATE_STEPS;
        let millidegrees = (self.millidegrees * (TIME_CONSTANT - 1) + final_value) / TIME_CONSTANT;
        *self = Self { millidegrees, loads: 0, steps: 0 };
    }

    pub(super) fn celsius(self) -> u8 {
        u8::try_from(self.millidegrees / 1_000).unwrap_or(u8::MAX)
    }
}
