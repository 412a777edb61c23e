//! Finds out whether the arm still answers. An arm that was switched off behind its adapter leaves the port open.
//!
//! ```text
//!   a reply ──▶ heard      1 s without one, while a read waits or a class watches ──▶ the hub asks, once a second
//!                          3 questions unanswered, each for a second ──▶ silent
//! ```
//!
//! While no read waits and no class watches, the hub does not ask a present arm: the line of an idle server is quiet.

use protocol_core::registers::map::DEVICE_CODE;
use protocol_core::time::{Duration, Instant};

/// Time between two questions.
const PERIOD: Duration = Duration::from_millis(1_000);
/// After this many unanswered questions, each with a timeout of 1 s, the arm counts as silent. The reply to one may be lost.
const MISSES: u8 = 3;

/// When the arm answered last, when it was asked last, and how many questions it missed.
#[derive(Debug, Default)]
pub(crate) struct Presence {
    heard: Instant,
    asked: Instant,
    misses: u8,
    /// The arm is asked also while no client reads.
    pub(crate) is_watched: bool,
}

impl Presence {
    /// The question: the first register, and how many.
    pub(crate) const QUESTION: (u8, u8) = (DEVICE_CODE.address, 1);

    /// Notes that the arm answered something.
    pub(crate) const fn hear(&mut self, now: Instant) {
        (self.heard, self.misses) = (now, 0);
    }

    /// When the next question is due. `is_waiting`: a read has no reply yet.
    pub(crate) fn due(&self, is_waiting: bool) -> Instant {
        match self.is_watched || is_waiting {
            true => self.heard.max(self.asked) + PERIOD,
            false => Instant::FAR_FUTURE,
        }
    }

    /// Notes that the question is sent.
    pub(crate) const fn ask(&mut self, now: Instant) {
        self.asked = now;
    }

    /// Notes an unanswered question. Returns whether the arm counts as silent.
    pub(crate) const fn miss(&mut self) -> bool {
        self.misses = self.misses.saturating_add(1);
        self.misses >= MISSES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn an_arm_is_asked_while_a_read_waits_or_somebody_watches() {
        let mut presence = Presence::default();
        presence.hear(at_ms(500));
        assert_eq!(presence.due(false), Instant::FAR_FUTURE);
        assert_eq!(presence.due(true), at_ms(1_500));
        presence.ask(at_ms(1_600));
        assert_eq!(presence.due(true), at_ms(2_600));
        presence.is_watched = true;
        assert_eq!(presence.due(false), at_ms(2_600));
    }

    #[test]
    fn an_arm_is_silent_after_three_questions_in_a_row() {
        let mut presence = Presence::default();
        assert_eq!([presence.miss(), presence.miss()], [false; 2]);
        presence.hear(at_ms(2_001));
        assert_eq!([presence.miss(), presence.miss(), presence.miss()], [false, false, true]);
    }
}
