//! Who has the real arm, and for how long.

use protocol_core::time::{Duration, Instant};

/// The longest time of a lease, in seconds.
const LONGEST: u32 = 3_600;

/// A lease. Its number distinguishes it from other leases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lease {
    pub(crate) number: u32,
    pub(crate) pupil: u32,
    until: Instant,
}

impl Lease {
    /// A lease that starts now; `None` if `seconds` is 0 or above [`LONGEST`].
    pub(crate) fn new(number: u32, pupil: u32, now: Instant, seconds: u32) -> Option<Self> {
        let time = Duration::from_millis(u64::from(seconds) * 1_000);
        (1..=LONGEST).contains(&seconds).then(|| Self { number, pupil, until: now + time })
    }

    pub(crate) fn is_over(&self, now: Instant) -> bool {
        self.until <= now
    }

    /// The remaining time in seconds, rounded up.
    pub(crate) fn seconds(&self, now: Instant) -> u32 {
        u32::try_from((self.until - now).as_micros().div_ceil(1_000_000)).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lease_has_a_bounded_time() {
        let now = Instant::from_micros(7);
        assert_eq!(Lease::new(1, 1, now, 0), None);
        assert_eq!(Lease::new(1, 1, now, LONGEST + 1), None);
        let lease = Lease::new(1, 1, now, 2);
        let after = |millis| now + Duration::from_millis(millis);
        let seen = [0, 1, 1_000, 1_999, 2_000]
            .map(|millis| lease.map(|lease| (lease.seconds(after(millis)), lease.is_over(after(millis)))));
        assert_eq!(seen, [(2, false), (2, false), (1, false), (1, false), (0, true)].map(Some));
    }
}
