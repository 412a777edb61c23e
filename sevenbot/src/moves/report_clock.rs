//! Estimates the time of measurement of each report from the time of its arrival.
//!
//! The arm reports without drift (D14), but USB adapters and a busy host deliver late, and several reports at once. So
//! a report gets the tick that follows the previous report's tick. It gets a later tick only if the later one is nearest
//! to its arrival: then reports count as lost.

use std::time::{Duration, Instant};

/// The ticks of the arm's report timer.
#[derive(Debug)]
pub(super) struct ReportClock {
    period: Duration,
    /// When the first report arrived, and the tick of the last one.
    last: Option<(Instant, u32)>,
}

impl ReportClock {
    pub(super) const fn new(period: Duration) -> Self {
        Self { period, last: None }
    }

    /// The time of measurement of a report, since the first report.
    pub(super) fn time_of(&mut self, received: Instant) -> Duration {
        let (first, tick) = match self.last {
            None => (received, 0),
            Some((first, tick)) => (first, self.nearest(received - first).max(tick.saturating_add(1))),
        };
        self.last = Some((first, tick));
        self.period.saturating_mul(tick)
    }

    /// The nearest tick to a time.
    fn nearest(&self, time: Duration) -> u32 {
        let ticks = (time + self.period / 2).as_micros() / self.period.as_micros().max(1);
        u32::try_from(ticks).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(received_ms: &[u64]) -> Vec<u128> {
        let start = Instant::now();
        let mut clock = ReportClock::new(Duration::from_millis(20));
        let time = |ms: &u64| clock.time_of(start + Duration::from_millis(*ms)).as_millis();
        received_ms.iter().map(time).collect()
    }

    #[test]
    fn late_reports_get_their_own_tick() {
        assert_eq!(times(&[0, 23, 38, 69, 80]), [0, 20, 40, 60, 80], "a little late each");
        assert_eq!(times(&[7, 27, 47]), [0, 20, 40], "time begins with the first");
        assert_eq!(times(&[0, 46, 46, 60]), [0, 40, 60, 80], "two at once never share a time");
    }

    #[test]
    fn lost_reports_leave_a_gap() {
        assert_eq!(times(&[0, 20, 101, 120]), [0, 20, 100, 120]);
    }
}
