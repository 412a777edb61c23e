//! Limits how fast the bytes of a client are taken. A flood of requests that the hub drops at once would keep the server
//! busy, and delay a stop of another client. So no connected client is read much faster than at [`TIMES_LINE`] times the
//! rate of the arm's line.

use host_link::time_on_line;
use protocol_core::time::{Duration, Instant};

/// A client may send this many times as much as the line carries: commands of the WebSocket are longer than frames.
const TIMES_LINE: u32 = 4;
/// A client may be ahead of that rate by this time.
const AHEAD: Duration = Duration::from_millis(20);

/// The bytes of one client, timed as if they passed a line of [`TIMES_LINE`] times the arm's baud rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClientPace {
    /// The baud rate of the arm's line, in bits per second.
    baud: u32,
    passed: Instant,
}

impl ClientPace {
    pub(super) const fn new(baud: u32) -> Self {
        Self { baud, passed: Instant::ZERO }
    }

    /// Notes that `bytes` bytes were read at `now`.
    pub(super) fn note(&mut self, now: Instant, bytes: usize) {
        self.passed = self.passed.max(now) + time_on_line(self.baud.saturating_mul(TIMES_LINE), bytes);
    }

    /// When more may be read.
    pub(super) fn free_at(&self) -> Instant {
        Instant::from_micros(self.passed.as_micros().saturating_sub(AHEAD.as_micros()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_is_read_four_times_as_fast_as_the_line() {
        let (mut pace, mut now, mut taken) = (ClientPace::new(115_200), Instant::from_micros(5_000_000), 0);
        let end = now + Duration::from_millis(1_000);
        while now < end {
            now = now.max(pace.free_at());
            pace.note(now, 512);
            taken += 512;
        }
        assert!((46_080..48_000).contains(&taken), "{taken}");
        assert!(pace.free_at() <= now + Duration::from_millis(12), "a pause of one piece");
    }
}
