//! The time that bytes take on a line, and how late a reply may be.

use protocol_core::time::{Duration, Instant};

/// The allowance until the first reply has come: a reply may be this much later than the time on the line explains. A USB
/// adapter holds received bytes back for up to 16 ms (the latency timer of FTDI chips). An arm answers within a control cycle
/// of 10 ms. The rest is for a busy host, or a server with other clients.
pub const ROUND_TRIP: Duration = Duration::from_millis(100);
/// The shortest allowance, for a line on which all replies came in time.
const SHORTEST: Duration = Duration::from_millis(4);
/// Microseconds of ten bits, a byte with start and stop bit, at 1 bit/s.
const BYTE: u64 = 10_000_000;
/// Each reply that comes in time shortens the allowance by 1/8.
const FORGETTING: u64 = 8;

/// The time that bytes take on a line; `baud` is in bits per second.
#[must_use]
pub fn time_on_line(baud: u32, bytes: usize) -> Duration {
    let bits = u64::try_from(bytes).unwrap_or(u64::MAX).saturating_mul(BYTE);
    Duration::from_micros(bits.div_ceil(u64::from(baud).max(1)))
}

/// When the bytes sent so far have left, and when replies are due.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LineTime {
    baud: u32,
    busy_until: Instant,
    /// When the last expected reply has arrived, if the arm answers at once.
    replies_until: Instant,
    /// Replies may be this much later than due.
    allowance: Duration,
}

impl LineTime {
    pub(crate) const fn new(baud: u32) -> Self {
        Self { baud, busy_until: Instant::ZERO, replies_until: Instant::ZERO, allowance: ROUND_TRIP }
    }

    /// Notes that these bytes are sent at `now`, after all earlier bytes.
    pub(crate) fn send(&mut self, now: Instant, bytes: usize) {
        self.busy_until = self.busy_until.max(now) + time_on_line(self.baud, bytes);
    }

    /// When the last byte leaves, or has left.
    pub(crate) const fn busy_until(&self) -> Instant {
        self.busy_until
    }

    /// How much later than due a reply may be: twice the recent delay. So a lost reply costs little on a line where replies
    /// come in time, and a server that became slower soon gets no needless repeats any more.
    pub(crate) const fn allowance(&self) -> Duration {
        self.allowance
    }

    /// Notes that a reply came at `now`, and was due at `due`. A longer delay lengthens the allowance at once. Any other
    /// reply shortens it by at most 1/8.
    pub(crate) fn note_reply(&mut self, due: Instant, now: Instant) {
        let forgotten = self.allowance.as_micros() / FORGETTING;
        let allowance = self.allowance.as_micros().saturating_sub(forgotten);
        let late = (now - due).as_micros().saturating_mul(2);
        self.allowance = Duration::from_micros(allowance.max(late).max(SHORTEST.as_micros()));
    }

    /// Notes that a reply of so many bytes follows the bytes sent so far. Returns when its last byte arrives, if the arm answers
    /// at once and no reply before it was lost.
    pub(crate) fn expect(&mut self, bytes: usize) -> Instant {
        self.replies_until = self.replies_until.max(self.busy_until) + time_on_line(self.baud, bytes);
        self.replies_until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_replies_are_learned_and_forgotten() {
        let (mut line, due) = (LineTime::new(115_200), Instant::from_micros(1_000_000));
        line.note_reply(due, due + Duration::from_millis(300));
        assert_eq!(line.allowance(), Duration::from_millis(600));
        line.note_reply(due, due);
        assert_eq!(line.allowance(), Duration::from_millis(525));
        (0..40).for_each(|_| line.note_reply(due, due));
        assert_eq!(line.allowance(), SHORTEST);
    }

    #[test]
    fn a_reply_is_due_when_request_and_replies_have_passed_the_line() {
        let mut line = LineTime::new(115_200);
        let now = Instant::from_micros(1_000);
        line.send(now, 7);
        assert_eq!((line.busy_until() - now).as_micros(), 608, "7 bytes of 10 bits");
        assert_eq!((line.expect(14) - now).as_micros(), 608 + 1_216);
        line.send(now, 7);
        assert_eq!((line.busy_until() - now).as_micros(), 2 * 608, "behind the first");
        assert_eq!((line.expect(14) - now).as_micros(), 608 + 2 * 1_216, "both ways at once");
        let later = Instant::from_micros(100_000);
        line.send(later, 7);
        assert_eq!(
            (line.expect(14) - later).as_micros(),
            608 + 1_216,
            "earlier replies have come or are lost"
        );
    }
}
