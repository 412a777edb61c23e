//! Rejects implausible positions of one joint, and detects a servo that does not answer.
//!
//! The checksum has eight bits, so one damaged answer in 256 passes it. A position is therefore accepted only if it is
//! within reach of the previous answer: as far as the motor can turn in the time between. A single outlier is rejected.
//! The position of a joint that was moved meanwhile is accepted at the second answer. The older the previous answer, the less
//! reliably an outlier is rejected, so a joint is given torque only after two nearly equal answers. This file does not know
//! angles or frames.

use core::ops::RangeInclusive;

use protocol_core::time::{Duration, Instant};

/// After this many consecutive reads without an accepted answer, the servo counts as silent
/// ([D12](protocol_core::decisions#d12)).
const GIVE_UP_AFTER: u8 = 3;
/// How long a silent servo is not read, because each read costs a timeout on the bus. With the wait for the next cycle
/// it is read ten times a second.
const RETRY_AFTER: Duration = Duration::from_millis(90);
/// How long the measured position of a joint without torque is valid: two control cycles. A falling joint moves by
/// about 2 degrees meanwhile.
const FRESH_FOR: Duration = Duration::from_millis(20);
/// The highest speed of a joint: 372 degrees/s ([D10](protocol_core::decisions#d10)) are at most 1757 counts per second. A
/// hand can be slightly faster.
const COUNTS_PER_SECOND: u32 = 2_000;
/// A joint that sinks this slowly counts as steady. Otherwise a joint whose servo is seldom read would engage only when it lies
/// at the bottom.
const SINKING_COUNTS_PER_SECOND: u32 = 60;
/// The allowance for sinking grows with the time between two answers, up to this time, where it is 15 counts.
const SINKS_FOR_MILLIS: u32 = 250;
/// After a longer pause, a false position may be within reach of the previous answer and yet so far away that a joint
/// whose set-point follows it would jump.
const LONG_PAUSE_MILLIS: u32 = 30;
/// The measured speeds that explain a large change of position in a pause, in counts per second.
const TURNING: RangeInclusive<u16> = 60..=2_000;
/// The largest difference between two readings of a joint at rest.
const JITTER_COUNTS: u32 = 8;

/// The result of filtering an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterOutcome {
    /// The position of the joint, in servo counts.
    Accepted(u16),
    /// The position is out of reach of the previous answer, or there is no previous answer.
    Rejected,
    /// The position is rejected, and the two reads before brought no accepted answer either: the servo counts as silent
    /// from now on.
    FellSilent,
}

/// The position filter of one joint.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PositionFilter {
    /// The last answer, accepted or rejected.
    last: Option<(u16, Instant)>,
    /// How long before the last answer its position may have been measured, in microseconds.
    last_micros: u16,
    /// The last accepted position, in servo counts; `None` while the servo is silent.
    position: Option<u16>,
    /// Were the last two answers nearly equal?
    is_steady: bool,
    /// Were the last two answers not nearly equal, with a long pause between them?
    is_jump: bool,
    /// Consecutive reads without an accepted answer.
    failures: u8,
    ask_again_at: Instant,
}

impl PositionFilter {
    /// The filter before the first answer.
    pub const UNKNOWN: Self = Self {
        last: None,
        last_micros: 0,
        position: None,
        is_steady: false,
        is_jump: false,
        failures: 0,
        ask_again_at: Instant::ZERO,
    };

    /// Filters the position that the servo answered at `now`. The servo measured the position in the `answer_micros`
    /// microseconds before.
    pub fn answered(&mut self, now: Instant, answer_micros: u16, counts: u16) -> FilterOutcome {
        let (distance, millis) = self.last.map_or((u32::MAX, 0), |(last, then)| {
            (u32::from(last.abs_diff(counts)), at_most_a_second(now - then))
        });
        let last_millis = u32::from(core::mem::replace(&mut self.last_micros, answer_micros)) / 1_000;
        let agrees = distance <= travel(millis + last_millis, COUNTS_PER_SECOND);
        self.is_steady = distance <= travel(millis.min(SINKS_FOR_MILLIS), SINKING_COUNTS_PER_SECOND);
        self.is_jump = !self.is_steady && millis > LONG_PAUSE_MILLIS;
        self.last = Some((counts, now));
        if agrees {
            self.position = Some(counts);
            self.failures = 0;
            return FilterOutcome::Accepted(counts);
        }
        if self.failures >= GIVE_UP_AFTER {
            // The servo answers again. If the next answer disagrees, it stays silent.
            self.failures = GIVE_UP_AFTER - 1;
            return FilterOutcome::Rejected;
        }
        if self.failed(now) { FilterOutcome::FellSilent } else { FilterOutcome::Rejected }
    }

    /// Records that the servo did not answer. Returns whether it counts as silent from now on.
    pub fn failed(&mut self, now: Instant) -> bool {
        self.failures = self.failures.saturating_add(1);
        if self.failures < GIVE_UP_AFTER {
            return false;
        }
        self.ask_again_at = now + RETRY_AFTER;
        self.last = None;
        self.position.take().is_some()
    }

    /// Is there an accepted position?
    #[must_use]
    pub const fn is_known(&self) -> bool {
        self.position.is_some()
    }

    /// The last accepted position, in servo counts.
    #[must_use]
    pub const fn position(&self) -> Option<u16> {
        self.position
    }

    /// Is the joint at rest according to the last two answers? If one of them is damaged, they are hardly ever nearly
    /// equal.
    #[must_use]
    pub const fn is_steady(&self) -> bool {
        self.is_steady
    }

    /// Did the position jump across a long pause, although `speed` does not explain the jump? Then the answer may be damaged.
    /// `speed` is from the last answer, in counts per second. A speed that is too low, or higher than a joint can turn,
    /// explains no jump.
    #[must_use]
    pub fn is_doubtful(&self, speed: i16) -> bool {
        self.is_jump && !TURNING.contains(&speed.unsigned_abs())
    }

    /// Was the last answer at most two control cycles ago?
    #[must_use]
    pub fn is_fresh(&self, now: Instant) -> bool {
        self.last.is_some_and(|(_, then)| now - then <= FRESH_FOR)
    }

    /// When the servo answered last; `None` if it has not answered since it fell silent.
    #[must_use]
    pub fn heard_at(&self) -> Option<Instant> {
        self.last.map(|(_, then)| then)
    }

    /// Is the servo to be read at `now`?
    #[must_use]
    pub fn wants_asking(&self, now: Instant) -> bool {
        self.failures < GIVE_UP_AFTER || now >= self.ask_again_at
    }
}

/// Whole milliseconds, at most 1,000: after a second every position is within reach.
fn at_most_a_second(time: Duration) -> u32 {
    // 32 bits are enough for a second, and the chip divides them in hardware.
    u32::try_from(time.as_micros()).unwrap_or(u32::MAX).min(1_000_000) / 1_000
}

/// How far two readings may be apart after this time at this speed.
const fn travel(millis: u32, counts_per_second: u32) -> u32 {
    JITTER_COUNTS + millis * counts_per_second / 1_000
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn the_first_position_is_accepted_after_a_second_answer() {
        let mut filter = PositionFilter::UNKNOWN;
        assert_eq!(filter.answered(at_ms(0), 0, 500), FilterOutcome::Rejected);
        assert!(!filter.is_known());
        assert_eq!(filter.answered(at_ms(10), 0, 501), FilterOutcome::Accepted(501));
        assert_eq!(filter.position(), Some(501));
    }

    #[test]
    fn an_outlier_is_rejected_and_a_new_position_is_accepted_at_the_second_answer() {
        let mut filter = PositionFilter::UNKNOWN;
        filter.answered(at_ms(0), 0, 500);
        filter.answered(at_ms(10), 0, 500);
        assert_eq!(filter.answered(at_ms(20), 0, 900), FilterOutcome::Rejected);
        assert_eq!(filter.position(), Some(500), "the old position is kept");
        assert_eq!(
            filter.answered(at_ms(30), 0, 500),
            FilterOutcome::Rejected,
            "it disagrees with the outlier"
        );
        assert_eq!(filter.answered(at_ms(40), 0, 500), FilterOutcome::Accepted(500));
    }

    #[test]
    fn a_joint_may_move_as_fast_as_its_motor() {
        let mut filter = PositionFilter::UNKNOWN;
        for (step, counts) in (0..=50).map(|step| (step, step * 18)) {
            let outcome = filter.answered(at_ms(u64::from(step) * 10), 0, counts);
            assert_eq!(outcome == FilterOutcome::Accepted(counts), step > 0);
        }
        let reach = |micros| travel(at_most_a_second(Duration::from_micros(micros)), COUNTS_PER_SECOND);
        assert_eq!([10_000, 10_999, u64::MAX].map(reach), [28, 28, 2_008]);
    }

    #[test]
    fn an_outlier_after_a_long_time_is_within_reach_but_not_steady() {
        let mut filter = PositionFilter::UNKNOWN;
        filter.answered(at_ms(0), 0, 404);
        filter.answered(at_ms(10), 0, 404);
        assert!(filter.is_steady());
        filter.failed(at_ms(100));
        assert_eq!(
            filter.answered(at_ms(300), 0, 1),
            FilterOutcome::Accepted(1),
            "the motor could have moved there"
        );
        assert!(!filter.is_steady(), "the joint is not given torque there");
        filter.answered(at_ms(310), 0, 404);
        assert!(!filter.is_steady());
        assert_eq!(filter.answered(at_ms(320), 0, 403), FilterOutcome::Accepted(403));
        assert!(filter.is_steady());
    }

    #[test]
    fn a_jump_after_a_long_pause_is_doubtful_unless_the_servo_turns() {
        let mut filter = PositionFilter::UNKNOWN;
        filter.answered(at_ms(0), 0, 541);
        filter.answered(at_ms(10), 0, 541);
        let doubtful = [
            (20, 565, 0, false),
            (140, 670, 0, true),
            (300, 541, 0, true),
            (310, 541, 0, false),
            (410, 641, 600, false),
            (510, 741, -600, false),
            (710, 641, 16_935, true),
            (810, 646, 16_935, false),
        ];
        for (millis, counts, speed, is_doubtful) in doubtful {
            assert_eq!(filter.answered(at_ms(millis), 0, counts), FilterOutcome::Accepted(counts));
            assert_eq!(filter.is_doubtful(speed), is_doubtful, "{counts} at {millis} ms");
        }
    }

    #[test]
    fn a_servo_is_silent_after_three_failures_and_is_read_again_later() {
        let mut filter = PositionFilter::UNKNOWN;
        filter.answered(at_ms(0), 0, 500);
        filter.answered(at_ms(10), 0, 500);
        assert!(!filter.failed(at_ms(20)));
        assert!(!filter.failed(at_ms(30)));
        assert!(filter.wants_asking(at_ms(31)));
        assert!(filter.is_known(), "two failures are not enough");
        assert!(filter.failed(at_ms(40)));
        assert!(!filter.is_known() && !filter.wants_asking(at_ms(129)) && filter.wants_asking(at_ms(130)));
        assert!(!filter.failed(at_ms(140)), "it was silent before");
        assert!(!filter.wants_asking(at_ms(229)));
        assert_eq!(filter.answered(at_ms(240), 0, 100), FilterOutcome::Rejected, "one answer is not enough");
        assert!(filter.wants_asking(at_ms(241)));
        assert_eq!(filter.answered(at_ms(250), 0, 100), FilterOutcome::Accepted(100));
    }

    #[test]
    fn d12_a_third_rejected_answer_makes_a_servo_silent() {
        let mut filter = PositionFilter::UNKNOWN;
        filter.answered(at_ms(0), 0, 500);
        filter.answered(at_ms(10), 0, 500);
        assert_eq!(filter.answered(at_ms(20), 0, 900), FilterOutcome::Rejected);
        assert!(!filter.failed(at_ms(30)));
        assert_eq!(filter.answered(at_ms(40), 0, 100), FilterOutcome::FellSilent);
        assert!(!filter.is_known() && !filter.wants_asking(at_ms(129)) && filter.wants_asking(at_ms(130)));
        assert_eq!(filter.answered(at_ms(130), 0, 500), FilterOutcome::Rejected);
        assert!(filter.wants_asking(at_ms(140)), "the next answer may agree");
        assert_eq!(filter.answered(at_ms(140), 0, 900), FilterOutcome::Rejected, "it was silent before");
        assert!(!filter.wants_asking(at_ms(229)) && filter.wants_asking(at_ms(230)));
        filter.answered(at_ms(230), 0, 500);
        assert_eq!(filter.answered(at_ms(240), 0, 500), FilterOutcome::Accepted(500));
    }

    #[test]
    fn a_joint_that_sinks_slowly_is_steady_however_seldom_its_servo_is_asked() {
        for (after_ms, counts, is_steady) in
            [(10, 8, true), (10, 9, false), (250, 23, true), (900, 24, false)]
        {
            let mut filter = PositionFilter::UNKNOWN;
            filter.answered(at_ms(0), 0, 500);
            filter.answered(at_ms(after_ms), 0, 500 + counts);
            assert_eq!(filter.is_steady(), is_steady, "{counts} counts in {after_ms} ms");
        }
    }

    #[test]
    fn a_joint_may_have_turned_while_its_answer_was_late() {
        for (answer_ms, is_accepted) in [(0, false), (40, true)] {
            let mut filter = PositionFilter::UNKNOWN;
            filter.answered(at_ms(0), 0, 571);
            filter.answered(at_ms(50), answer_ms * 1_000, 540);
            let outcome = filter.answered(at_ms(58), 0, 509);
            assert_eq!(outcome == FilterOutcome::Accepted(509), is_accepted, "{outcome:?}");
        }
    }
}
