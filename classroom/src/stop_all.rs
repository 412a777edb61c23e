//! Repeats a stop until each arm has confirmed it.

use protocol_core::time::{Duration, Instant};

use crate::message::{StopNews, StopOutcome, TileStop};

/// A stop that an arm has not confirmed is sent again after this time; at the real arm, not while a hold is in progress.
const REPEAT: Duration = Duration::from_millis(100);

/// A stop on its way to one arm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PendingStop {
    pub(crate) number: u32,
    /// The time at which it has to be sent next.
    due: Instant,
    pub(crate) was_sent: bool,
    outcome: Option<StopOutcome>,
}

impl PendingStop {
    pub(crate) const fn new(number: u32, now: Instant) -> Self {
        Self { number, due: now, was_sent: false, outcome: None }
    }

    /// True if it has to be sent now.
    pub(crate) fn is_due(&self, now: Instant) -> bool {
        self.outcome.is_none() && self.due <= now
    }

    /// Records that it was sent. It is due again after [`REPEAT`].
    pub(crate) fn sent(&mut self, now: Instant) {
        (self.due, self.was_sent) = (now + REPEAT, true);
    }

    /// Makes it due at once, because the tab has a new connection.
    pub(crate) const fn send_again(&mut self, now: Instant) {
        self.due = now;
    }

    /// Takes a confirmation. Returns true for the first one of this stop.
    pub(crate) fn confirm(&mut self, number: u32, outcome: StopOutcome) -> bool {
        let is_news = number == self.number && self.outcome.is_none();
        if is_news {
            self.outcome = Some(outcome);
        }
        is_news
    }

    pub(crate) fn tile(&self) -> TileStop {
        self.outcome.map_or(TileStop::Asked, TileStop::from)
    }
}

/// The last stop for all.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StopAll {
    pub(crate) number: u32,
    began: Instant,
    last_confirmed: Instant,
}

impl StopAll {
    pub(crate) const fn new(number: u32, now: Instant) -> Self {
        Self { number, began: now, last_confirmed: now }
    }

    /// Records the time of a confirmation.
    pub(crate) const fn note_confirmed(&mut self, now: Instant) {
        self.last_confirmed = now;
    }

    /// The progress of the stop, from the state of each arm.
    pub(crate) fn news(&self, arms: impl Iterator<Item = TileStop>) -> StopNews {
        let count = |(asked, confirmed), arm| (asked + 1, confirmed + usize::from(arm != TileStop::Asked));
        let (asked, confirmed) = arms.fold((0, 0), count);
        let millis = (self.last_confirmed - self.began).as_micros() / 1_000;
        StopNews { number: self.number, asked, confirmed, millis }
    }
}
