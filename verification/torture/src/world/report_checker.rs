//! Checks the number of reports of each stream (D14, M4).

use motion_core::report_timer::highest_frequency;
use protocol_core::time::{Duration, Instant};

use crate::violation::{Check, ensure};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReportStream {
    /// The reports of register 53.
    Positions,
    /// The reports of register 82.
    Angles,
    /// The reports of register 90.
    Loads,
}

impl ReportStream {
    pub(super) const fn of(frame: &[u8]) -> Self {
        match frame {
            [_, _, 5, 83, ..] => Self::Angles,
            [_, _, 5, ..] => Self::Loads,
            _ => Self::Positions,
        }
    }

    /// The function code, the first register and the number of registers of the stream's frames. `content` is register 189.
    pub(super) const fn frame(self, content: u8) -> (u8, u8, u8) {
        match (self, content) {
            (Self::Positions, 0) => (3, 54, 7),
            (Self::Positions, 1) => (3, 142, 14),
            (Self::Positions, _) => (3, 142, 42),
            (Self::Angles, _) => (5, 83, 7),
            (Self::Loads, _) => (5, 91, 7),
        }
    }
}

/// The reports of a stream since the last change of its frequency.
#[derive(Clone, Copy, Debug)]
struct ReportCount {
    /// The frequency in Hz, limited to the capacity of the line (D14, M4).
    frequency: u32,
    since: Instant,
    count: u64,
    /// True if a stall or a full link held up reports.
    disturbed: bool,
}

#[derive(Debug)]
pub(super) struct ReportChecker([ReportCount; 3]);

impl ReportChecker {
    pub(super) const fn new(now: Instant) -> Self {
        Self([ReportCount { frequency: 0, since: now, count: 0, disturbed: false }; 3])
    }

    /// Something held up reports.
    pub(super) fn disturb(&mut self) {
        self.0.iter_mut().for_each(|count| count.disturbed = true);
    }

    /// A write was accepted. `frequencies` are the registers 53, 82 and 90, `content` is register 189.
    pub(super) fn frequencies_written(&mut self, now: Instant, frequencies: [u8; 3], content: u8, baud: u32) {
        let (_, _, length) = ReportStream::Positions.frame(content);
        let most = [length, 7].map(|length| highest_frequency(baud, length));
        for (count, frequency) in self.0.iter_mut().zip(limited(frequencies.map(u32::from), most)) {
            if frequency != count.frequency {
                *count = ReportCount { frequency, since: now, count: 0, disturbed: false };
            }
        }
    }

    pub(super) fn sent(&mut self, now: Instant, stream: ReportStream) -> Check {
        let [positions, angles, loads] = &mut self.0;
        let counted = match stream {
            ReportStream::Positions => positions,
            ReportStream::Angles => angles,
            ReportStream::Loads => loads,
        };
        counted.count += 1;
        let ReportCount { frequency, count, .. } = *counted;
        let due = counted.due(now);
        ensure(frequency > 0 && count <= due + 1, || {
            format!("{count} reports of {stream:?} instead of {due} at {frequency} Hz")
        })
    }

    pub(super) fn check(&self, now: Instant) -> Check {
        for counted in &self.0 {
            let (ReportCount { frequency, count, disturbed, .. }, due) = (*counted, counted.due(now));
            ensure(disturbed || count + 2 >= due, || {
                format!("{count} reports instead of {due} at {frequency} Hz")
            })?;
        }
        Ok(())
    }
}

impl ReportCount {
    fn due(&self, now: Instant) -> u64 {
        let elapsed: Duration = now - self.since;
        elapsed.as_micros() * u64::from(self.frequency) / 1_000_000
    }
}

/// Limits the frequencies to the capacity of the line, in reports a second: `most_positions` for register 53, and `most` for
/// the two streams of map 2.1 together. The two share `most` in the ratio of their frequencies, at least 1 Hz each.
fn limited([positions, angles, loads]: [u32; 3], [most_positions, most]: [u32; 2]) -> [u32; 3] {
    let sum = angles + loads;
    let share = |wanted: u32| match (wanted * most).checked_div(sum) {
        Some(share) if sum > most => share.max(wanted.min(1)),
        _ => wanted,
    };
    [positions.min(most_positions), share(angles), share(loads)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_of_a_stream_that_is_off_is_a_violation() {
        let at = |millis: u64| Instant::from_micros(millis * 1_000);
        let mut reports = ReportChecker::new(at(0));
        reports.frequencies_written(at(0), [0, 10, 0], 0, 115_200);
        assert!(reports.sent(at(100), ReportStream::Angles).is_ok());
        assert!(reports.sent(at(100), ReportStream::Positions).is_err());
        assert!(reports.sent(at(100), ReportStream::Angles).is_ok(), "one early");
        assert!(reports.sent(at(100), ReportStream::Angles).is_err());
        assert!(reports.check(at(500)).is_ok() && reports.check(at(700)).is_err());
        assert_eq!(limited([50, 100, 100], [10, 34]), [10, 17, 17]);
    }
}
