//! What is known about where one joint is, and how far that can be trusted.
//!
//! A checksum of eight bits lets one garbled answer in 256 through. So a position counts only when the
//! answer before it agrees, as far as a motor can turn in between; a single wild value is never believed,
//! and a joint that was moved while nobody looked is believed again at the second look. The longer ago the
//! answer before, the less it speaks against a wild value; so a joint is given torque only at two answers that
//! are alike. Knows nothing of angles or frames.

use protocol_core::time::{Duration, Instant};

/// So many questions in a row without an answer, and the servo counts as missing.
const GIVE_UP_AFTER: u8 = 3;
/// How long a missing servo is not asked, as each time costs the bus a time-out. Its turn comes with the cycle after
/// that, which makes it ten times a second.
const RETRY_AFTER: Duration = Duration::from_millis(90);
/// The fastest a joint turns: 372 degrees/s (D10) are 1757 counts a second, a little more by hand.
const COUNTS_PER_MILLISECOND: u32 = 2;
/// How far two readings of a joint at rest may be apart.
const JITTER_COUNTS: u32 = 8;

/// One joint's measurements.
#[derive(Clone, Copy, Debug)]
pub struct Sensor {
    /// The last answer, believed or not.
    last: Option<(u16, Instant)>,
    /// Where the joint is, in servo counts, if that is known.
    position: Option<u16>,
    /// Were the last two answers alike?
    is_steady: bool,
    failures: u8,
    ask_again_at: Instant,
}

impl Sensor {
    /// Nothing is known yet.
    pub const UNKNOWN: Self =
        Self { last: None, position: None, is_steady: false, failures: 0, ask_again_at: Instant::ZERO };

    /// Takes the position that the servo answered at `now`, and gives it back if it is to be believed.
    pub fn answered(&mut self, now: Instant, counts: u16) -> Option<u16> {
        self.failures = 0;
        let (way, time) = self.last.map_or((u32::MAX, Duration::ZERO), |(last, then)| {
            (u32::from(last.abs_diff(counts)), now - then)
        });
        let agrees = way <= reach(time);
        self.is_steady = way <= JITTER_COUNTS;
        self.last = Some((counts, now));
        if agrees {
            self.position = Some(counts);
        }
        self.position.filter(|_| agrees)
    }

    /// The servo did not answer at `now`. Says whether that makes it missing, just now.
    pub fn failed(&mut self, now: Instant) -> bool {
        self.failures = self.failures.saturating_add(1);
        if self.failures < GIVE_UP_AFTER {
            return false;
        }
        self.ask_again_at = now + RETRY_AFTER;
        self.last = None;
        self.position.take().is_some()
    }

    /// Is it known where the joint is?
    #[must_use]
    pub const fn is_known(&self) -> bool {
        self.position.is_some()
    }

    /// Where the joint is, in servo counts, if that is known.
    #[must_use]
    pub const fn position(&self) -> Option<u16> {
        self.position
    }

    /// Is the joint at rest, as far as its last two answers can tell? Where one of them is damaged and passes
    /// for right, they are hardly ever alike.
    #[must_use]
    pub const fn is_steady(&self) -> bool {
        self.is_steady
    }

    /// Should the servo be asked at `now`?
    #[must_use]
    pub fn wants_asking(&self, now: Instant) -> bool {
        self.failures < GIVE_UP_AFTER || now >= self.ask_again_at
    }
}

/// How many counts a joint can turn in `time`.
fn reach(time: Duration) -> u32 {
    // Past a second anything can be reached; in 32 bits the chip divides by itself.
    let micros = u32::try_from(time.as_micros()).unwrap_or(u32::MAX).min(1_000_000);
    JITTER_COUNTS + micros * COUNTS_PER_MILLISECOND / 1_000
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn the_first_answer_needs_a_second_that_agrees() {
        let mut sensor = Sensor::UNKNOWN;
        assert_eq!(sensor.answered(at_ms(0), 500), None);
        assert!(!sensor.is_known());
        assert_eq!(sensor.answered(at_ms(10), 501), Some(501));
        assert_eq!(sensor.position(), Some(501));
    }

    #[test]
    fn a_wild_value_is_not_believed_but_a_new_place_is_at_the_second_look() {
        let mut sensor = Sensor::UNKNOWN;
        sensor.answered(at_ms(0), 500);
        sensor.answered(at_ms(10), 500);
        assert_eq!(sensor.answered(at_ms(20), 900), None);
        assert_eq!(sensor.position(), Some(500), "the old one stands");
        assert_eq!(sensor.answered(at_ms(30), 500), None, "it disagrees with the wild one");
        assert_eq!(sensor.answered(at_ms(40), 500), Some(500));
    }

    #[test]
    fn a_joint_may_move_as_fast_as_its_motor() {
        let mut sensor = Sensor::UNKNOWN;
        for (step, counts) in (0..=50).map(|step| (step, step * 18)) {
            let believed = sensor.answered(at_ms(u64::from(step) * 10), counts);
            assert_eq!(believed, (step > 0).then_some(counts));
        }
        assert_eq!(reach(Duration::from_millis(10)), 28);
        assert_eq!(reach(Duration::from_micros(u64::MAX)), 2_008);
    }

    #[test]
    fn a_wild_value_after_a_long_time_is_within_reach_but_not_steady() {
        let mut sensor = Sensor::UNKNOWN;
        sensor.answered(at_ms(0), 404);
        sensor.answered(at_ms(10), 404);
        assert!(sensor.is_steady());
        sensor.failed(at_ms(100));
        assert_eq!(sensor.answered(at_ms(300), 1), Some(1), "a motor could have made that way");
        assert!(!sensor.is_steady(), "but this is no place to give it torque");
        sensor.answered(at_ms(310), 404);
        assert!(!sensor.is_steady());
        assert_eq!(sensor.answered(at_ms(320), 403), Some(403));
        assert!(sensor.is_steady());
    }

    #[test]
    fn a_servo_is_missing_after_three_failures_and_asked_again_after_a_while() {
        let mut sensor = Sensor::UNKNOWN;
        sensor.answered(at_ms(0), 500);
        sensor.answered(at_ms(10), 500);
        assert!(!sensor.failed(at_ms(20)));
        assert!(!sensor.failed(at_ms(30)));
        assert!(sensor.wants_asking(at_ms(31)));
        assert!(sensor.is_known(), "two failures are not the end");
        assert!(sensor.failed(at_ms(40)));
        assert!(!sensor.is_known() && !sensor.wants_asking(at_ms(129)) && sensor.wants_asking(at_ms(130)));
        assert!(!sensor.failed(at_ms(140)), "it was missing before");
        assert!(!sensor.wants_asking(at_ms(229)));
        assert_eq!(sensor.answered(at_ms(240), 100), None, "one answer is not enough to be back");
        assert!(sensor.wants_asking(at_ms(241)));
        assert_eq!(sensor.answered(at_ms(250), 100), Some(100));
    }
}
