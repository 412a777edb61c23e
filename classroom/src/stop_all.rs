//! A stop for all, until each arm has confirmed it.

use protocol_core::time::{Duration, Instant};

use crate::message::{StopNews, StopOutcome, TileStop};

/// An arm that has not confirmed is told again after this time.
const REPEAT: Duration = Duration::from_millis(100);

/// A stop on its way to one arm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PendingStop {
    pub(crate) number: u32,
    /// When it has to be sent.
    due: Instant,
    pub(crate) was_sent: bool,
    outcome: Option<StopOutcome>,
}

impl PendingStop {
    pub(crate) const fn new(number: u32, now: Instant) -> Self {
        Self { number, due: now, was_sent: false, outcome: None }
    }

    /// Has it to be sent now?
    pub(crate) fn is_due(&self, now: Instant) -> bool {
        self.outcome.is_none() && self.due <= now
    }

    /// It was sent.
    pub(crate) fn sent(&mut self, now: Instant) {
        (self.due, self.was_sent) = (now + REPEAT, true);
    }

    /// A new connection has to be told at once.
    pub(crate) const fn send_again(&mut self, now: Instant) {
        self.due = now;
    }

    /// The arm confirms. Returns whether that is news.
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

    /// An arm has confirmed.
    pub(crate) const fn note_confirmed(&mut self, now: Instant) {
        self.last_confirmed = now;
    }

    /// What came of it, from what each arm says.
    pub(crate) fn news(&self, arms: impl Iterator<Item = TileStop>) -> StopNews {
        let count = |(asked, confirmed), arm| (asked + 1, confirmed + usize::from(arm != TileStop::Asked));
        let (asked, confirmed) = arms.fold((0, 0), count);
        let millis = (self.last_confirmed - self.began).as_micros() / 1_000;
        StopNews { number: self.number, asked, confirmed, millis }
    }
}
