//! A histogram of round-trip times. Its size does not depend on their number.

use std::fmt::{self, Display};
use std::time::Duration;

/// The width of a bucket in microseconds.
const BUCKET_MICROS: u128 = 10;
/// The number of buckets. The last one, at a second, also counts longer times.
const BUCKETS: usize = 100_000;

/// The round trips of a load.
#[derive(Debug)]
pub(super) struct RoundTrips {
    counts: Vec<u64>,
    worst: Duration,
}

impl Default for RoundTrips {
    fn default() -> Self {
        Self { counts: vec![0; BUCKETS], worst: Duration::ZERO }
    }
}

impl RoundTrips {
    pub(super) fn add(&mut self, took: Duration) {
        let bucket = usize::try_from(took.as_micros() / BUCKET_MICROS).unwrap_or(usize::MAX).min(BUCKETS - 1);
        self.counts.get_mut(bucket).into_iter().for_each(|count| *count += 1);
        self.worst = self.worst.max(took);
    }

    /// The time in milliseconds that this many thousandths of the round trips do not exceed, rounded to a bucket, so at most a
    /// second; 0 without round trips.
    fn quantile_ms(&self, thousandths: u64) -> f64 {
        let rank = self.counts.iter().sum::<u64>() * thousandths / 1_000;
        let mut seen = 0;
        let bucket = self.counts.iter().position(|count| {
            seen += count;
            seen > rank
        });
        #[allow(clippy::cast_precision_loss)] // At most 100 000.
        let micros = bucket.map_or(0.0, |bucket| (bucket as f64 + 0.5) * BUCKET_MICROS as f64);
        micros / 1_000.0
    }
}

impl Display for RoundTrips {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (median, p999) = (self.quantile_ms(500), self.quantile_ms(999));
        let worst = self.worst.as_secs_f64() * 1_000.0;
        write!(out, "median {median:.2} ms, 99.9 % within {p999:.2} ms, worst {worst:.2} ms")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_rounded_to_buckets_and_the_worst_time_is_exact() {
        let mut trips = RoundTrips::default();
        assert_eq!(trips.to_string(), "median 0.00 ms, 99.9 % within 0.00 ms, worst 0.00 ms");
        (1..=99).for_each(|millis| trips.add(Duration::from_millis(millis)));
        trips.add(Duration::from_secs(3));
        assert_eq!(trips.to_string(), "median 51.01 ms, 99.9 % within 1000.00 ms, worst 3000.00 ms");
    }
}
