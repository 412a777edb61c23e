//! The reads that still want a reply, and when each is repeated or given up.

use std::collections::VecDeque;

use protocol_core::time::{Duration, Instant};

use crate::event::RequestId;
use crate::line_time::ROUND_TRIP;
use crate::span::Span;

/// How long to wait for the reply to a read, and whether to repeat the read meanwhile.
///
/// A read is repeated as soon as its reply is later than an allowance: twice the recent delay of replies, and
/// [`ROUND_TRIP`] before the first reply. The time to the next repeat doubles, up to [`ROUND_TRIP`] or the allowance,
/// whichever is longer, and never exceeds `timeout`. A read whose reply comes damaged is repeated at once. A read changes
/// nothing, so a needless repeat does no harm. The read is given up `attempts` times `timeout` after the reply to its first
/// attempt was due, or earlier if its reply is known to be lost and it may not be repeated. So a lost reply costs little time,
/// several lost replies are no error, and a slow arm gets the whole time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// The wait for the reply lasts this many times `timeout`, at least once. A read with one attempt is not repeated.
    pub attempts: u32,
    /// The time that each attempt adds to the wait. The wait begins when the reply to the first attempt is due.
    pub timeout: Duration,
}

impl Patience {
    /// The time until the read is given up.
    fn total(self) -> Duration {
        Duration::from_micros(self.timeout.as_micros().saturating_mul(self.attempts.max(1).into()))
    }

    /// Is the read repeated at all?
    const fn repeats(self) -> bool {
        self.attempts > 1
    }

    /// The time from when the reply to attempt number `sent`, from 1, is due to the next attempt.
    fn before_repeat(self, sent: u32, allowance: Duration) -> Duration {
        let doubled = allowance.as_micros().saturating_mul(1 << sent.saturating_sub(1).min(32));
        let longest = self.timeout.min(allowance.max(ROUND_TRIP));
        longest.min(Duration::from_micros(doubled))
    }
}

/// A read that still wants a reply.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenRead {
    pub(crate) id: RequestId,
    pub(crate) wanted: Span,
    pub(crate) patience: Patience,
    /// How many times it was sent, except for attempts whose reply came damaged.
    sent: u32,
    /// How many writes were sent before its last attempt.
    writes_before: u64,
    /// When it is repeated or given up.
    due: Instant,
    give_up_at: Option<Instant>,
}

impl OpenRead {
    pub(crate) const fn new(id: RequestId, wanted: Span, patience: Patience) -> Self {
        Self { id, wanted, patience, sent: 0, writes_before: 0, due: Instant::FAR_FUTURE, give_up_at: None }
    }

    /// Notes that the read is sent; `writes` counts the writes sent before it. Its reply is due at `reply_due`, and may be later
    /// by the allowance.
    pub(crate) fn note_sent(&mut self, reply_due: Instant, allowance: Duration, writes: u64) {
        self.sent = self.sent.saturating_add(1);
        self.writes_before = writes;
        let give_up_at = *self.give_up_at.get_or_insert(reply_due + self.patience.total());
        let repeat_at = reply_due + self.patience.before_repeat(self.sent, allowance);
        self.due = if self.patience.repeats() { repeat_at.min(give_up_at) } else { give_up_at };
    }

    /// May it be sent again? Not if a write was sent since: the repeat would read what the write changed. `writes` counts all
    /// writes so far.
    pub(crate) const fn may_repeat(&self, writes: u64) -> bool {
        self.patience.repeats() && self.writes_before == writes
    }

    /// Waits until the read is given up, because it is not repeated any more.
    fn wait_to_the_end(&mut self) {
        self.due = self.give_up_at.unwrap_or(self.due);
    }
}

/// What is to be done with a read whose time has come.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Overdue {
    Repeat(OpenRead),
    GiveUp(OpenRead),
}

/// The reads that were sent and still want a reply, in the order in which each was sent last.
#[derive(Clone, Debug, Default)]
pub(crate) struct OpenReads(VecDeque<OpenRead>);

impl OpenReads {
    pub(crate) fn push(&mut self, read: OpenRead) {
        self.0.push_back(read);
    }

    pub(crate) fn take(&mut self, id: RequestId) -> Option<OpenRead> {
        let index = self.0.iter().position(|read| read.id == id)?;
        self.0.remove(index)
    }

    pub(crate) fn take_all(&mut self) -> impl Iterator<Item = OpenRead> {
        self.0.drain(..)
    }

    /// The reply to this read came damaged at `now`: the read is repeated at once, if it may be. The attempt does not lengthen
    /// the time to the next repeat, because the arm answers in time.
    pub(crate) fn note_damage(&mut self, id: RequestId, now: Instant) {
        let damaged = self.0.iter_mut().find(|read| read.id == id && read.patience.repeats());
        if let Some(read) = damaged {
            (read.sent, read.due) = (read.sent.saturating_sub(1), read.due.min(now));
        }
    }

    /// Takes out a read whose time has come at `now`. `writes` counts all writes so far.
    pub(crate) fn take_overdue(&mut self, now: Instant, writes: u64) -> Option<Overdue> {
        while let Some(index) = self.0.iter().position(|read| read.due <= now) {
            let read = self.0.get_mut(index)?;
            if read.may_repeat(writes) && read.give_up_at.is_some_and(|at| now < at) {
                return self.0.remove(index).map(Overdue::Repeat);
            }
            read.wait_to_the_end();
            if read.due <= now {
                return self.0.remove(index).map(Overdue::GiveUp);
            }
        }
        None
    }

    /// When the next read is repeated or given up.
    pub(crate) fn due(&self) -> Instant {
        self.0.iter().map(|read| read.due).min().unwrap_or(Instant::FAR_FUTURE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_to_the_next_repeat_doubles_up_to_a_limit() {
        let patience = Patience { attempts: u32::MAX, timeout: Duration::from_millis(500) };
        let allowance = Duration::from_millis(4);
        let times = [1, 2, 3, 59, 64, u32::MAX].map(|sent| patience.before_repeat(sent, allowance));
        assert_eq!(times, [4, 8, 16, 100, 100, 100].map(Duration::from_millis));
    }
}
