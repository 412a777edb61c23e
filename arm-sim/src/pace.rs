//! The timing of a serial line: a byte takes ten bits at the baud rate.
//!
//! ```text
//!   push ──▶ [ in transit: on the line ][ arrived: can be taken ] ──▶ take
//! ```
//!
//! The line loses no bytes: it accepts as many as it has room for, and arrived bytes stay until they are taken. This module
//! does not interpret them.

use alloc::collections::VecDeque;

use protocol_core::time::{Duration, Instant};
use protocol_core::wire::MAX_LENGTH;

/// Bytes that a direction holds: two of the longest frames, so that one can wait while the other is sent.
pub const CAPACITY: usize = 2 * MAX_LENGTH;
/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;
/// [`Pacer::deadline`] waits for a batch: as many bytes as the line carries in this time, in microseconds. A wake-up for each
/// byte would take much processor time, and serial adapters deliver bytes in batches, too.
const BATCH_MICROS: u64 = 1_000;

/// One direction of a serial line.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pacer {
    /// In bits per second. `None`: bytes arrive at once.
    baud: Option<u64>,
    queue: VecDeque<u8>,
    /// Number of bytes at the front of the queue that have arrived.
    arrived: usize,
    /// The line has been busy without a pause since this time.
    busy_since: Instant,
    /// Number of bytes that have arrived since `busy_since`.
    sent: u64,
    /// The length of a batch of bytes for [`Pacer::deadline`], in microseconds. 0: a batch is one byte.
    batch_micros: u64,
}

impl Pacer {
    /// An idle line. `baud` is in bits per second; `None` or 0: bytes arrive at once.
    #[must_use]
    pub fn new(baud: Option<u32>) -> Self {
        Self {
            baud: baud.filter(|&baud| baud > 0).map(u64::from),
            queue: VecDeque::with_capacity(CAPACITY),
            arrived: 0,
            busy_since: Instant::ZERO,
            sent: 0,
            batch_micros: BATCH_MICROS,
        }
    }

    /// Gives each byte its own deadline. Then the times at which bytes are taken do not depend on the bytes behind them.
    pub const fn set_bytewise(&mut self) {
        self.batch_micros = 0;
    }

    /// Number of bytes that the line accepts.
    #[must_use]
    pub fn room(&self) -> usize {
        CAPACITY.saturating_sub(self.queue.len())
    }

    /// Are there no bytes, neither in transit nor arrived?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }

    /// Number of bytes, in transit or arrived.
    #[must_use]
    pub fn len(&self) -> usize {
        self.queue.len()
    }

    /// Starts to send bytes at `now`. Returns how many were accepted.
    pub fn push(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.advance(now);
        // A byte that starts when the last one ends continues the busy period, so that the rounding to microseconds does not
        // accumulate.
        if self.in_transit() == 0 && self.end_of(self.sent) != Some(now) {
            self.busy_since = now;
            self.sent = 0;
        }
        let taken = bytes.get(..self.room()).unwrap_or(bytes);
        self.queue.extend(taken);
        self.advance(now);
        taken.len()
    }

    /// Marks the bytes that have arrived by `now`.
    pub fn advance(&mut self, now: Instant) {
        if self.in_transit() == 0 {
            return;
        }
        let due = match self.baud {
            None => self.in_transit(),
            Some(baud) => {
                let elapsed = (now - self.busy_since).as_micros();
                let since = elapsed.saturating_mul(baud) / (BITS_PER_BYTE * 1_000_000);
                usize::try_from(since.saturating_sub(self.sent)).unwrap_or(usize::MAX).min(self.in_transit())
            }
        };
        self.arrived += due;
        self.sent += due as u64;
    }

    /// The first bytes that have arrived, possibly not all of them.
    #[must_use]
    pub fn arrived(&self) -> &[u8] {
        let (front, _) = self.queue.as_slices();
        front.get(..self.arrived).unwrap_or(front)
    }

    /// Removes the first `count` of the bytes that have arrived.
    pub fn take(&mut self, count: usize) {
        let count = count.min(self.arrived);
        if count > 0 {
            self.queue.drain(..count);
            self.arrived -= count;
        }
    }

    /// When the next batch of bytes has arrived; `None` if no byte is in transit.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        let in_transit = self.in_transit() as u64;
        let baud = self.baud.filter(|_| in_transit > 0)?;
        let batch = (baud * self.batch_micros / (BITS_PER_BYTE * 1_000_000)).clamp(1, in_transit);
        self.end_of(self.sent + batch)
    }

    /// When this many bytes have arrived, counted from `busy_since`. `None` if they arrive at once.
    fn end_of(&self, count: u64) -> Option<Instant> {
        let micros = count.saturating_mul(BITS_PER_BYTE * 1_000_000).div_ceil(self.baud?);
        Some(self.busy_since + Duration::from_micros(micros))
    }

    pub(crate) fn in_transit(&self) -> usize {
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
    fn bytes_in_one_piece_or_in_two_without_a_pause_arrive_at_the_same_times() {
        let mut whole = Pacer::new(Some(115_200));
        let mut parts = Pacer::new(Some(115_200));
        whole.set_bytewise();
        parts.set_bytewise();
        whole.push(micros(0), b"abcdefgh");
        parts.push(micros(0), b"abc");
        for byte in 1..=8 {
            let now = whole.deadline().unwrap();
            assert_eq!(parts.deadline(), Some(now), "byte {byte}");
            whole.advance(now);
            parts.advance(now);
            if byte == 3 {
                parts.push(now, b"defgh");
            }
            assert_eq!((whole.arrived().len(), parts.arrived().len()), (byte, byte));
        }
    }

    #[test]
    fn an_idle_line_saves_no_time_for_later() {
        let mut line = Pacer::new(Some(100_000));
        line.push(micros(0), b"a");
        line.push(micros(50_000), b"b");
        assert_eq!(line.arrived(), b"a", "it was not taken, and it is still there");
        assert_eq!(line.deadline(), Some(micros(50_100)));
    }

    #[test]
    fn bytes_without_room_are_not_accepted() {
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
    fn the_deadline_is_the_end_of_a_short_message_or_a_millisecond_of_a_long_one() {
        let mut line = Pacer::new(Some(100_000));
        line.push(micros(0), b"short");
        assert_eq!(line.deadline(), Some(micros(500)));
        line.push(micros(0), &[0; 100]);
        assert_eq!(line.deadline(), Some(micros(1_000)));
    }
}
