//! The supply voltage of a chip over time, and the comparator that monitors it.

/// A voltage over time, linear between points.
#[derive(Clone, Debug)]
pub struct FlashSupply {
    /// Times in microseconds and voltages in millivolts, in ascending order of time. The last voltage stays.
    points: Vec<(u32, u32)>,
}

impl FlashSupply {
    /// A supply of `millivolts` at all times, unless [`Self::then`] adds points.
    #[must_use]
    pub fn steady(millivolts: u32) -> Self {
        Self { points: vec![(0, millivolts)] }
    }

    /// Adds a point: `millivolts` at `micros`, which must be later than all points before.
    #[must_use]
    pub fn then(mut self, micros: u32, millivolts: u32) -> Self {
        self.points.push((micros, millivolts));
        self
    }

    /// The voltage in millivolts at `micros`.
    #[must_use]
    pub fn at(&self, micros: u32) -> u32 {
        let after = self.points.iter().find(|(time, _)| *time > micros);
        let before = self.points.iter().rfind(|(time, _)| *time <= micros);
        match (before, after) {
            (Some(&(from, start)), Some(&(to, end))) => between((from, start), (to, end), micros),
            (Some(&(_, millivolts)), None) | (None, Some(&(_, millivolts))) => millivolts,
            (None, None) => 0,
        }
    }
}

fn between((from, start): (u32, u32), (to, end): (u32, u32), micros: u32) -> u32 {
    let (passed, whole) = (i64::from(micros - from), i64::from(to - from));
    let millivolts = i64::from(start) + (i64::from(end) - i64::from(start)) * passed / whole;
    u32::try_from(millivolts).unwrap_or(0)
}

/// A comparator with hysteresis. The supply is low from a fall below the lower threshold until it reaches the higher one.
#[derive(Clone, Copy, Debug)]
pub struct Comparator {
    falls_below: u32,
    rises_above: u32,
    is_low: bool,
}

impl Comparator {
    /// A comparator with these thresholds in millivolts. It starts low.
    #[must_use]
    pub const fn new(falls_below: u32, rises_above: u32) -> Self {
        Self { falls_below, rises_above, is_low: true }
    }

    /// Compares the present voltage with the threshold. Returns true if the supply is low.
    pub const fn is_low(&mut self, millivolts: u32) -> bool {
        let threshold = if self.is_low { self.rises_above } else { self.falls_below };
        self.is_low = millivolts < threshold;
        self.is_low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_voltage_is_interpolated_between_points() {
        let supply = FlashSupply::steady(3_300).then(100, 3_300).then(200, 2_800).then(600, 3_300);
        assert_eq!(
            [0, 99, 150, 200, 400, 9_999].map(|at| supply.at(at)),
            [3_300, 3_300, 3_050, 2_800, 3_050, 3_300]
        );
    }

    #[test]
    fn a_comparator_stays_low_between_its_thresholds() {
        let mut comparator = Comparator::new(2_900, 3_000);
        let seen = [2_950, 3_010, 2_950, 2_890, 2_950, 3_000].map(|supply| comparator.is_low(supply));
        assert_eq!(seen, [true, false, false, true, true, false]);
    }
}
