//! When the maker's firmware sends a feedback frame.

use protocol_core::time::{Duration, Instant};

#[derive(Clone, Debug)]
pub(super) struct Feedback {
    period: Duration,
    due: Instant,
}

impl Default for Feedback {
    fn default() -> Self {
        Self { period: Duration::ZERO, due: Instant::FAR_FUTURE }
    }
}

impl Feedback {
    /// Starts the stream: the first frame at once, the next ones each 1000 ms / `hertz`, rounded down, plus 1 ms. 0 ends it.
    pub(super) fn set_frequency(&mut self, now: Instant, hertz: u8) {
        match 1_000_u64.checked_div(u64::from(hertz)) {
            Some(millis) => *self = Self { period: Duration::from_millis(millis + 1), due: now },
            None => *self = Self::default(),
        }
    }

    /// When the next frame is due.
    pub(super) const fn due(&self) -> Instant {
        self.due
    }

    /// Is a frame due at `now`? If so, the next one is due a period later.
    pub(super) fn take_due(&mut self, now: Instant) -> bool {
        let is_due = now >= self.due;
        if is_due {
            self.due = now + self.period;
        }
        is_due
    }
}
