//! How long bytes take on the servo bus. This file knows the baud rate only.

use protocol_core::time::Duration;

/// The time of a byte on the wire: ten bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ByteTime {
    /// The time of one bit, rounded up.
    bit_nanos: u32,
}

impl ByteTime {
    /// The time of a byte at `baud` bits per second. A rate of 0 counts as 1.
    #[must_use]
    pub const fn at_baud(baud: u32) -> Self {
        const SECOND_NANOS: u32 = 1_000_000_000;
        let divisor = if baud == 0 { 1 } else { baud };
        Self { bit_nanos: SECOND_NANOS.div_ceil(divisor) }
    }

    /// The time of `count` bytes without a pause between them, rounded up to microseconds. A time above 42 s counts as 42 s.
    #[must_use]
    pub fn of(self, count: usize) -> Duration {
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        // Ten bits of n nanoseconds each take n / 100 microseconds.
        let micros = self.bit_nanos.saturating_mul(count).div_ceil(100);
        Duration::from_micros(u64::from(micros))
    }

    /// How many whole bytes pass within `time`.
    #[must_use]
    pub fn count_within(self, time: Duration) -> u64 {
        time.as_micros().saturating_mul(100).checked_div(u64::from(self.bit_nanos)).unwrap_or(u64::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servo_bus::frame::BAUD_RATES;

    #[test]
    fn a_frame_of_seven_goals_takes_its_time_at_each_rate() {
        let micros = [1_000_000, 500_000, 115_200].map(|baud| ByteTime::at_baud(baud).of(57).as_micros());
        assert_eq!(micros, [570, 1_140, 4_949]);
    }

    #[test]
    fn a_time_is_never_too_short_and_at_most_a_thousandth_too_long() {
        for baud in BAUD_RATES {
            for count in 1..=64 {
                let exact = f64::from(count) * 1e7 / f64::from(baud);
                let micros = ByteTime::at_baud(baud).of(usize::try_from(count).unwrap()).as_micros();
                let micros = f64::from(u32::try_from(micros).unwrap());
                assert!((exact..=exact * 1.001 + 1.0).contains(&micros), "{count} at {baud}: {micros}");
            }
        }
    }

    #[test]
    fn the_bytes_within_their_time_are_all_of_them() {
        for baud in BAUD_RATES {
            let time = ByteTime::at_baud(baud);
            for count in 1..=64_u8 {
                let taken = time.of(count.into());
                assert_eq!(time.count_within(taken), count.into(), "{baud}");
                let less = Duration::from_micros(taken.as_micros() - 1);
                assert!(time.count_within(less) < count.into(), "{baud}");
            }
        }
    }

    #[test]
    fn no_rate_and_no_count_overflows() {
        assert_eq!(ByteTime::at_baud(0).of(usize::MAX), Duration::from_micros(42_949_673));
        assert_eq!(ByteTime::at_baud(u32::MAX).of(0), Duration::ZERO);
        assert_eq!(
            ByteTime::at_baud(1).count_within(Duration::from_millis(u64::MAX / 1_000)),
            18_446_744_073
        );
    }
}
