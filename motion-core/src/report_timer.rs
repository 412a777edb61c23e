//! The timer of reports ([D14](protocol_core::decisions#d14), [D26](protocol_core::decisions#d26)). This file does not know
//! the content of a report.

use protocol_core::time::{Duration, Instant};
use protocol_core::wire::MIN_LENGTH;

/// The highest frequency in Hz at which reports of this many registers use at most half of the line. `baud` is in bits per
/// second; a byte takes ten bits.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "an empty frame has 7 bytes")]
pub const fn highest_frequency(baud: u32, registers: u8) -> u32 {
    // `as` widens here: `From` is not const. The length is at least 7, so the division cannot panic.
    baud / 10 / 2 / (MIN_LENGTH as u32 + registers as u32)
}

/// A timer that becomes due `frequency` times a second, without drift.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReportTimer {
    /// In Hz; 0 is off.
    frequency: u32,
    due: Instant,
    /// The accumulated rounding error of the periods, in 1/frequency microseconds.
    remainder: u32,
}

impl ReportTimer {
    /// Never due, until a frequency is set.
    pub const OFF: Self = Self { frequency: 0, due: Instant::FAR_FUTURE, remainder: 0 };

    /// Sets the frequency in Hz, as a frequency register holds it, limited to `highest`. The first report is due one
    /// period after `now`. Setting the same frequency again has no effect.
    pub fn set(&mut self, now: Instant, frequency: u8, highest: u32) {
        let frequency = u32::from(frequency).min(highest);
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

    /// Returns whether a report is due, once for each report. A call that is late by a period or more skips the missed
    /// reports; the next report is due one period after the call.
    pub fn poll_due(&mut self, now: Instant) -> bool {
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

    fn timer(now: Instant, frequency: u8, baud: u32) -> ReportTimer {
        let mut timer = ReportTimer::OFF;
        timer.set(now, frequency, highest_frequency(baud, 7));
        timer
    }

    #[test]
    fn d14_reports_take_at_most_half_the_line() {
        assert_eq!(highest_frequency(9_600, 7), 34);
        assert_eq!(highest_frequency(19_200, 7), 68);
        assert_eq!([14, 42].map(|registers| highest_frequency(9_600, registers)), [22, 9], "(D26)");
        let mut timer = timer(at(0), 50, 9_600);
        let reports = (0..1_000_000).step_by(500).filter(|&now| timer.poll_due(at(now))).count();
        assert_eq!(reports, 33, "34 Hz, the last one at one second");
    }

    #[test]
    fn d14_an_hour_has_exactly_its_reports() {
        for frequency in 1..=50 {
            let mut timer = timer(at(7), frequency, 115_200);
            for _ in 1..u32::from(frequency) * 3_600 {
                let due = timer.due();
                assert!(timer.poll_due(due));
            }
            assert_eq!(timer.due(), at(3_600_000_007), "{frequency} Hz");
        }
    }

    #[test]
    fn d14_a_late_report_does_not_delay_the_next_and_a_missed_report_is_skipped() {
        let mut timer = timer(at(0), 10, 115_200);
        assert!(!timer.poll_due(at(99_999)));
        assert!(timer.poll_due(at(150_000)));
        assert_eq!(timer.due(), at(200_000));
        assert!(timer.poll_due(at(350_000)));
        assert!(!timer.poll_due(at(350_001)), "missed reports are skipped");
        assert_eq!(timer.due(), at(450_000));
    }

    #[test]
    fn d14_setting_the_same_frequency_again_has_no_effect() {
        let mut timer = timer(at(0), 10, 115_200);
        timer.set(at(99_000), 10, 411);
        assert_eq!(timer.due(), at(100_000));
        timer.set(at(99_000), 20, 411);
        assert_eq!(timer.due(), at(149_000));
        timer.set(at(149_000), 0, 411);
        assert_eq!(timer.due(), Instant::FAR_FUTURE);
    }

    #[test]
    fn d14_frequency_zero_never_reports() {
        let mut timer = timer(at(5), 0, 115_200);
        assert!(!timer.poll_due(at(u64::MAX / 2)));
        assert_eq!(timer.due(), Instant::FAR_FUTURE);
    }
}
