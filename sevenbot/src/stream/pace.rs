//! When the points of a stream are due, and how late they were sent: arithmetic without an arm or a clock. All times count
//! from the same instant, as [`Arm::elapsed`](crate::Arm::elapsed) does.

use std::time::Duration;

/// A point may be early or late by a quarter of the period: the velocity then ripples by less than 5 % (D23).
const TOLERANCE_DIVISOR: u32 = 4;

/// The due times of a stream: one each period after the start, without drift.
///
/// ```
/// use sevenbot::stream::StreamPace;
/// use std::time::Duration;
///
/// let (start, period) = (Duration::from_secs(5), Duration::from_millis(20));
/// let mut pace = StreamPace::new(start, period);
/// assert_eq!(pace.take(start), 0);
/// assert_eq!(pace.due(), start + period);
/// assert_eq!(pace.take(start + 5 * period / 2), 2, "the point of 20 ms is passed over");
/// ```
#[derive(Clone, Debug)]
pub struct StreamPace {
    start: Duration,
    period: Duration,
    next: u32,
    last_taken: Option<Duration>,
    counts: PaceCounts,
}

/// How well a stream kept its due times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PaceCounts {
    /// Points that were sent, without those that were passed over.
    pub points: u32,
    /// Points later than a quarter of the period, points that were passed over, and pauses.
    pub late: u32,
    /// The largest time between two points.
    pub largest_gap: Duration,
    sum: f64,
    squares: f64,
}

impl PaceCounts {
    /// The standard deviation of the delays between the due times of points and the times when they were sent.
    #[must_use]
    pub fn jitter(&self) -> Duration {
        let count = f64::from(self.points.max(1));
        let mean = self.sum / count;
        Duration::try_from_secs_f64((self.squares / count - mean * mean).max(0.0).sqrt()).unwrap_or_default()
    }
}

impl StreamPace {
    /// The first point is due at `start`.
    #[must_use]
    pub fn new(start: Duration, period: Duration) -> Self {
        Self { start, period, next: 0, last_taken: None, counts: PaceCounts::default() }
    }

    /// When the first point was due; after [`Self::restart`], the first point after the pause.
    #[must_use]
    pub const fn start(&self) -> Duration {
        self.start
    }

    /// When the next point is due.
    #[must_use]
    pub fn due(&self) -> Duration {
        self.start + self.period.saturating_mul(self.next)
    }

    /// The number of the point to send at `now`: the next one, or the latest one that is due. The arm would pass over the
    /// earlier ones (D23).
    #[must_use]
    pub fn number_at(&self, now: Duration) -> u32 {
        let lateness = now.saturating_sub(self.due());
        let passed = lateness.as_micros() / self.period.as_micros().max(1);
        self.next.saturating_add(u32::try_from(passed).unwrap_or(u32::MAX))
    }

    /// Takes the point to send at `now`, and counts its lateness. Returns its number, as [`Self::number_at`].
    pub fn take(&mut self, now: Duration) -> u32 {
        let number = self.number_at(now);
        let passed = number.saturating_sub(self.next);
        self.next = number;
        self.count(now.saturating_sub(self.due()), passed, now);
        self.next = number.saturating_add(1);
        number
    }

    /// Makes the next point due at `now`: the source of the points has paused. The pause counts as one late point.
    pub fn restart(&mut self, now: Duration) {
        self.start = now;
        self.next = 0;
        self.counts.late = self.counts.late.saturating_add(1);
    }

    /// How well the stream kept its due times so far.
    #[must_use]
    pub const fn counts(&self) -> PaceCounts {
        self.counts
    }

    fn count(&mut self, lateness: Duration, passed: u32, now: Duration) {
        let is_late = lateness > self.period / TOLERANCE_DIVISOR;
        let gap = self.last_taken.map_or(Duration::ZERO, |last| now.saturating_sub(last));
        let counts = &mut self.counts;
        counts.points = counts.points.saturating_add(1);
        counts.late = counts.late.saturating_add(passed).saturating_add(u32::from(is_late));
        counts.largest_gap = counts.largest_gap.max(gap);
        counts.sum += lateness.as_secs_f64();
        counts.squares += lateness.as_secs_f64().powi(2);
        self.last_taken = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(20);

    #[test]
    fn due_times_do_not_drift() {
        let start = Duration::from_secs(5);
        let mut pace = StreamPace::new(start, PERIOD);
        for number in 0..50 {
            let due = start + PERIOD * number;
            assert_eq!(pace.due(), due);
            assert_eq!(pace.take(due + Duration::from_millis(4)), number);
        }
        let counts = pace.counts();
        assert_eq!((counts.points, counts.late, counts.largest_gap), (50, 0, PERIOD));
        assert!(counts.jitter() < Duration::from_micros(1), "evenly late: {:?}", counts.jitter());
    }

    #[test]
    fn points_that_are_too_late_are_passed_over_and_counted() {
        let start = Duration::from_secs(5);
        let mut pace = StreamPace::new(start, PERIOD);
        pace.take(start);
        assert_eq!(pace.take(start + Duration::from_millis(26)), 1, "late by more than a quarter");
        assert_eq!(pace.take(start + Duration::from_millis(101)), 5, "2, 3 and 4 are passed over");
        let counts = pace.counts();
        assert_eq!((counts.points, counts.late, counts.largest_gap.as_millis()), (3, 4, 75));
        assert!(
            (counts.jitter().as_secs_f64() - 0.002_625).abs() < 1e-4,
            "0, 6 and 1 ms: {:?}",
            counts.jitter()
        );
    }

    #[test]
    fn a_pause_of_the_source_starts_the_due_times_again() {
        let start = Duration::from_secs(5);
        let mut pace = StreamPace::new(start, PERIOD);
        pace.take(start);
        let later = start + Duration::from_secs(5);
        pace.restart(later);
        assert_eq!((pace.take(later), pace.due()), (0, later + PERIOD));
        assert_eq!((pace.counts().late, pace.counts().largest_gap), (1, Duration::from_secs(5)));
    }
}
