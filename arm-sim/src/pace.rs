//! A serial line's sense of time: bytes take ten bits each at the baud rate, one after the other.
//!
//! ```text
//!   push ──▶ [ flying: still on the line ][ arrived: waiting to be taken ] ──▶ take
//! ```
//!
//! The line never loses a byte: it has room for so many and refuses more, and what has arrived stays until
//! somebody takes it. Knows nothing of what the bytes mean, nor of who sends them.

use std::collections::VecDeque;

use protocol_core::time::Instant;
use protocol_core::wire::MAX_LENGTH;

/// Bytes one direction holds: two of the longest frames, so that one can be queued while another is sent.
pub const CAPACITY: usize = 2 * MAX_LENGTH;
/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;
/// Arrivals are handed over in batches of so many microseconds, not byte by byte: one wake-up costs more
/// than a byte, and no serial adapter is finer than this either.
const BATCH_MICROS: u64 = 1_000;

/// One direction of a serial line.
#[derive(Debug)]
pub struct Pacer {
    /// In bits per second; `None`: bytes arrive at once.
    baud: Option<u64>,
    queue: VecDeque<u8>,
    /// How many bytes at the front of the queue have arrived.
    arrived: usize,
    /// Since when the line has been busy without a pause.
    busy_since: Instant,
    /// How many bytes have arrived since then.
    sent: u64,
}

impl Pacer {
    /// A line at rest. `baud` is in bits per second; `None` or 0: bytes arrive at once.
    #[must_use]
    pub fn new(baud: Option<u32>) -> Self {
        Self {
            baud: baud.filter(|&baud| baud > 0).map(u64::from),
            queue: VecDeque::with_capacity(CAPACITY),
            arrived: 0,
            busy_since: Instant::ZERO,
            sent: 0,
        }
    }

    /// How many more bytes the line holds.
    #[must_use]
    pub fn room(&self) -> usize {
        CAPACITY.saturating_sub(self.queue.len())
    }

    /// Is nothing on the line, and nothing waiting to be taken?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }

    /// Begins to send bytes at `now`, and says how many found room.
    pub fn push(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.advance(now);
        if self.flying() == 0 {
            self.busy_since = now;
            self.sent = 0;
        }
        let taken = bytes.get(..self.room()).unwrap_or(bytes);
        self.queue.extend(taken);
        self.advance(now);
        taken.len()
    }

    /// Lets the bytes arrive that are due by `now`.
    pub fn advance(&mut self, now: Instant) {
        let due = match self.baud {
            None => self.flying(),
            Some(baud) => {
                let elapsed = (now - self.busy_since).as_micros();
                let since = elapsed.saturating_mul(baud) / (BITS_PER_BYTE * 1_000_000);
                usize::try_from(since.saturating_sub(self.sent)).unwrap_or(usize::MAX).min(self.flying())
            }
        };
        self.arrived += due;
        self.sent += due as u64;
    }

    /// Bytes that have arrived, from the first on; possibly not all of them at once.
    #[must_use]
    pub fn arrived(&self) -> &[u8] {
        let (front, _) = self.queue.as_slices();
        front.get(..self.arrived).unwrap_or(front)
    }

    /// Takes the first `count` of the bytes that have arrived off the line.
    pub fn take(&mut self, count: usize) {
        let count = count.min(self.arrived);
        self.queue.drain(..count);
        self.arrived -= count;
    }

    /// When the next batch will have arrived; `None` if nothing is on its way.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        let flying = self.flying() as u64;
        let baud = self.baud.filter(|_| flying > 0)?;
        let batch = (baud * BATCH_MICROS / (BITS_PER_BYTE * 1_000_000)).clamp(1, flying);
        let micros = ((self.sent + batch) * BITS_PER_BYTE * 1_000_000).div_ceil(baud);
        Some(self.busy_since + protocol_core::time::Duration::from_micros(micros))
    }

    fn flying(&self) -> usize {
        self.queue.len() - self.arrived
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn micros(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    #[test]
    fn a_byte_takes_ten_bits() {
        let mut line = Pacer::new(Some(100_000));
        assert_eq!(line.push(micros(1_000), b"abc"), 3);
        line.advance(micros(1_099));
        assert_eq!(line.arrived(), b"");
        line.advance(micros(1_100));
        assert_eq!(line.arrived(), b"a");
        line.advance(micros(1_300));
        assert_eq!(line.arrived(), b"abc");
        line.take(2);
        assert_eq!(line.arrived(), b"c");
    }

    #[test]
    fn a_busy_line_keeps_its_rate_without_drift_at_any_baud_rate() {
        for baud in protocol_core::registers::map::BAUD_RATES {
            let mut line = Pacer::new(Some(baud));
            let (mut now, mut received) = (Instant::ZERO, 0_u64);
            while received < u64::from(baud) / 10 {
                line.push(now, &[0; 300]);
                now = line.deadline().unwrap();
                line.advance(now);
                while !line.arrived().is_empty() {
                    received += line.arrived().len() as u64;
                    line.take(line.arrived().len());
                }
            }
            let late = now.as_micros() - received * 10_000_000 / u64::from(baud);
            assert!(late <= 1, "{baud} baud: {late} us late after {received} bytes");
        }
    }

    #[test]
    fn a_line_that_was_idle_or_blocked_does_not_make_up_for_it() {
        let mut line = Pacer::new(Some(100_000));
        line.push(micros(0), b"a");
        line.push(micros(50_000), b"b");
        assert_eq!(line.arrived(), b"a", "nobody took it, and it is still there");
        assert_eq!(line.deadline(), Some(micros(50_100)));
    }

    #[test]
    fn what_does_not_fit_is_left_with_the_sender() {
        let mut line = Pacer::new(Some(9_600));
        assert_eq!(line.push(micros(0), &[1; CAPACITY + 5]), CAPACITY);
        assert_eq!((line.room(), line.push(micros(0), &[2])), (0, 0));
        line.advance(micros(u64::MAX));
        line.take(10);
        assert_eq!(line.room(), 10);
    }

    #[test]
    fn unpaced_bytes_arrive_at_once() {
        let mut line = Pacer::new(None);
        line.push(micros(7), b"now");
        assert_eq!((line.arrived(), line.deadline()), (b"now".as_slice(), None));
    }

    #[test]
    fn a_short_message_is_handed_over_whole_and_a_long_one_by_the_millisecond() {
        let mut line = Pacer::new(Some(100_000));
        line.push(micros(0), b"short");
        assert_eq!(line.deadline(), Some(micros(500)));
        line.push(micros(0), &[0; 100]);
        assert_eq!(line.deadline(), Some(micros(1_000)));
    }
}
