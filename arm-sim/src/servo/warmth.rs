//! The temperature of one simulated servo: it follows the load, slowly. The figures are assumed.

/// The temperature around the arm, in thousandths of a degree Celsius.
const AMBIENT: u32 = 25_000;
/// How much warmer a servo gets in the long run for each 0.1 % it pushes, in thousandths of a degree.
const WARMTH_PER_LOAD: u32 = 40;
/// The steps between two looks at the temperature: a second.
const WARMING_STEPS: u32 = 1_000;
/// The time constant of the temperature, in such looks.
const WARMING_LAG: u32 = 300;

/// How warm a servo is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Warmth {
    /// In thousandths of a degree Celsius.
    millidegrees: u32,
    /// The loads of the steps since the last look.
    loads: u32,
    steps: u32,
}

impl Default for Warmth {
    fn default() -> Self {
        Self { millidegrees: AMBIENT, loads: 0, steps: 0 }
    }
}

impl Warmth {
    pub(super) fn step(&mut self, load: u16) {
        self.loads += u32::from(load);
        self.steps += 1;
        if self.steps < WARMING_STEPS {
            return;
        }
        let aim = AMBIENT + WARMTH_PER_LOAD * self.loads / WARMING_STEPS;
        let millidegrees = (self.millidegrees * (WARMING_LAG - 1) + aim) / WARMING_LAG;
        *self = Self { millidegrees, loads: 0, steps: 0 };
    }

    pub(super) fn celsius(self) -> u8 {
        u8::try_from(self.millidegrees / 1_000).unwrap_or(u8::MAX)
    }
}
