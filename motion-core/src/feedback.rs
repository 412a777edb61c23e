//! When to report the present positions unasked (D14). Knows nothing of what a report looks like.

use protocol_core::time::{Duration, Instant};

/// Bytes of one report: seven registers in their envelope.
const REPORT_LENGTH: u32 = 14;

/// The highest frequency at which reports take no more than half the line, in Hz; `baud` in bits per
/// second, ten bits a byte.
#[must_use]
pub const fn highest_frequency(baud: u32) -> u32 {
    baud / 10 / 2 / REPORT_LENGTH
}

/// A clock that strikes `frequency` times a second, without drift.
#[derive(Clone, Copy, Debug)]
pub struct Feedback {
    /// In Hz; 0: never.
    frequency: u32,
    due: Instant,
    /// What the rounding of periods to microseconds has swallowed, in 1/frequency microseconds.
    remainder: u32,
}

impl Feedback {
    /// No reports.
    pub const OFF: Self = Self { frequency: 0, due: Instant::FAR_FUTURE, remainder: 0 };

    /// Reports from `now` on, `frequency` (register 53, 0 to 50 Hz) times a second or as often as `baud`
    /// allows; the first after one period. A host that repeats itself does not disturb the rhythm.
    pub fn set(&mut self, now: Instant, frequency: u8, baud: u32) {
        let frequency = u32::from(frequency).min(highest_frequency(baud));
        if frequency != self.frequency {
            *self = Self { frequency, due: now, remainder: 0 };
            self.advance();
        }
    }

    /// When the next report is due.
    #[must_use]
    pub const fn due(&self) -> Instant {
        self.due
    }

    /// Is a report due? Asks once for each. Whoever asks a whole period late gets one report, not the missed
    /// ones, and the next a period later.
    pub fn strike(&mut self, now: Instant) -> bool {
        if self.due > now {
            return false;
        }
        self.advance();
        if self.due <= now {
            self.due = now;
            self.advance();
        }
        true
    }

    fn advance(&mut self) {
        let (period, rest) =
            (1_000_000_u32.checked_div(self.frequency), 1_000_000_u32.checked_rem(self.frequency));
        let (Some(period), Some(rest)) = (period, rest) else {
            self.due = Instant::FAR_FUTURE;
            return;
        };
        self.due = self.due + Duration::from_micros(period.into());
        self.remainder += rest;
        if self.remainder >= self.frequency {
            self.remainder -= self.frequency;
            self.due = self.due + Duration::from_micros(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn feedback(now: Instant, frequency: u8, baud: u32) -> Feedback {
        let mut feedback = Feedback::OFF;
        feedback.set(now, frequency, baud);
        feedback
    }

    #[test]
    fn d14_reports_take_at_most_half_the_line() {
        assert_eq!(highest_frequency(9_600), 34);
        assert_eq!(highest_frequency(19_200), 68);
        let mut feedback = feedback(at(0), 50, 9_600);
        let strikes = (0..1_000_000).step_by(500).filter(|&now| feedback.strike(at(now))).count();
        assert_eq!(strikes, 33, "34 Hz, the last one at one second");
    }

    #[test]
    fn d14_an_hour_has_exactly_its_reports() {
        for frequency in 1..=50 {
            let mut feedback = feedback(at(7), frequency, 115_200);
            for _ in 1..u32::from(frequency) * 3_600 {
                let due = feedback.due();
                assert!(feedback.strike(due));
            }
            assert_eq!(feedback.due(), at(3_600_000_007), "{frequency} Hz");
        }
    }

    #[test]
    fn d14_a_late_report_does_not_delay_the_next_and_a_missed_one_is_skipped() {
        let mut feedback = feedback(at(0), 10, 115_200);
        assert!(!feedback.strike(at(99_999)));
        assert!(feedback.strike(at(150_000)));
        assert_eq!(feedback.due(), at(200_000));
        assert!(feedback.strike(at(350_000)));
        assert!(!feedback.strike(at(350_001)), "no making up");
        assert_eq!(feedback.due(), at(450_000));
    }

    #[test]
    fn d14_repeating_the_frequency_does_not_disturb_the_rhythm() {
        let mut feedback = feedback(at(0), 10, 115_200);
        feedback.set(at(99_000), 10, 115_200);
        assert_eq!(feedback.due(), at(100_000));
        feedback.set(at(99_000), 20, 115_200);
        assert_eq!(feedback.due(), at(149_000));
        feedback.set(at(149_000), 0, 115_200);
        assert_eq!(feedback.due(), Instant::FAR_FUTURE);
    }

    #[test]
    fn d14_frequency_zero_never_reports() {
        let mut feedback = feedback(at(5), 0, 115_200);
        assert!(!feedback.strike(at(u64::MAX / 2)));
        assert_eq!(feedback.due(), Instant::FAR_FUTURE);
    }
}
