//! The time that bytes take on a line, and how late a reply may be.

use protocol_core::time::{Duration, Instant};

/// A reply may come this much later than the line explains. A USB adapter holds bytes back for up to 16 ms in each direction
/// (the latency timer of FTDI chips). An arm answers within a control cycle of 10 ms. The rest is for a busy host, or a server
/// with other clients.
pub const ROUND_TRIP: Duration = Duration::from_millis(100);
/// Microseconds of ten bits, a byte with start and stop bit, at 1 bit/s.
const BYTE: u64 = 10_000_000;
/// Reports take up to half of the line (D14), so that a reply may take twice its own time.
const REPORT_SHARE: u64 = 2;

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
}

impl LineTime {
    pub(crate) const fn new(baud: u32) -> Self {
        Self { baud, busy_until: Instant::ZERO }
    }

    /// Notes that these bytes are sent at `now`, behind those before.
    pub(crate) fn send(&mut self, now: Instant, bytes: usize) {
        self.busy_until = self.busy_until.max(now) + time_on_line(self.baud, bytes);
    }

    /// When the last byte leaves, or has left.
    pub(crate) const fn busy_until(&self) -> Instant {
        self.busy_until
    }

    /// When the last byte of the replies on their way has arrived, if the arm answers at once.
    pub(crate) fn reply_due(&self, now: Instant, awaited_bytes: usize) -> Instant {
        let replies = time_on_line(self.baud, awaited_bytes).as_micros().saturating_mul(REPORT_SHARE);
        self.busy_until.max(now) + Duration::from_micros(replies)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reply_is_due_when_request_and_replies_have_passed_the_line() {
        let mut line = LineTime::new(115_200);
        let now = Instant::from_micros(1_000);
        line.send(now, 7);
        assert_eq!((line.busy_until() - now).as_micros(), 608, "7 bytes of 10 bits");
        assert_eq!((line.reply_due(now, 14) - now).as_micros(), 608 + 2 * 1_216);
        line.send(now, 7);
        assert_eq!((line.busy_until() - now).as_micros(), 2 * 608, "behind the first");
    }
}
