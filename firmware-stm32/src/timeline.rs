//! 64-bit time from a 32-bit microsecond counter that wraps every 71 minutes.

use protocol_core::time::Instant;

/// Extends the counter to 64 bits. [`Timeline::extend`] has to be called at least once between two wraps.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timeline {
    turns: u32,
    last: u32,
}

impl Timeline {
    /// A time line that starts at a count of 0.
    #[must_use]
    pub const fn new() -> Self {
        Self { turns: 0, last: 0 }
    }

    /// The time at which the counter shows `count`.
    pub fn extend(&mut self, count: u32) -> Instant {
        if count < self.last {
            self.turns = self.turns.wrapping_add(1);
        }
        self.last = count;
        Instant::from_micros(u64::from(self.turns) << 32 | u64::from(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_on_where_the_counter_wraps() {
        let mut timeline = Timeline::new();
        assert_eq!(timeline.extend(7).as_micros(), 7);
        assert_eq!(timeline.extend(7).as_micros(), 7, "looking twice is no turn");
        assert_eq!(timeline.extend(u32::MAX).as_micros(), 0xFFFF_FFFF);
        assert_eq!(timeline.extend(0).as_micros(), 0x1_0000_0000);
        assert_eq!(timeline.extend(5).as_micros(), 0x1_0000_0005);
    }

    #[test]
    fn one_call_per_hour_is_enough() {
        let hour = 3_600_000_000u64;
        let mut timeline = Timeline::new();
        for hours in 0..=24 {
            let count = u32::try_from((hours * hour) & 0xFFFF_FFFF).unwrap();
            assert_eq!(timeline.extend(count).as_micros(), hours * hour);
        }
    }
}
