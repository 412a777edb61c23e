//! Splits a stream of bytes into frames, and re-synchronises after damage ([D3](crate::decisions#d3),
//! [D4](crate::decisions#d4)).
//!
//! ```text
//!      finished       the head: first byte that
//!                     may begin a frame
//!   ┌───────────────┬──────────────────────────────────────────────┐
//!   │ . . . . . . . │ AA 77 06 10 FF  ..  AA 77 03 36 07 81 CE  .. │ ◀── push
//!   └───────────────┴──────────────────────────────────────────────┘
//!                     ╰─ incomplete: claims   ╰─ complete: comes out once the
//!                        262 bytes               line was silent for the gap
//! ```
//!
//! * A frame at the head comes out as soon as its last byte is in the buffer.
//! * If the head is not a frame, the search continues with the next byte.
//! * Behind an incomplete head, complete frames come out after a short silence (the gap), while the head keeps
//!   waiting. After the timeout ([`ABANDON_AFTER`]) the head is abandoned. So a false header in noise holds frames
//!   back only until the next gap, and a frame survives a pause of its sender that is shorter than the timeout.
//! * If the last bytes of a frame could begin a header, the next frame may begin with them. A frame may have lost its
//!   own last byte and be completed by the first byte of the next frame; this rule keeps that next frame.
//!
//! Only an empty [`Deframer::push`] counts as silence: it states that no byte waits in a driver or in the kernel. The
//! arrival time of bytes that waited is unknown. So a shell that was delayed for a second does not mistake its own
//! delay for a pause of the sender.

use core::marker::PhantomData;

use super::frame::{Defect, Direction, Frame, MAX_LENGTH};
use super::search::Search;
use crate::time::{Duration, Instant};

/// The shortest gap (D4).
const SHORTEST_GAP: Duration = Duration::from_millis(2);
/// Timeout after which an incomplete frame is abandoned ([D4](crate::decisions#d4)).
pub const ABANDON_AFTER: Duration = Duration::from_millis(100);

/// The silence after which complete frames may pass an incomplete one ([D4](crate::decisions#d4)). It is 2 ms, or three
/// and a half characters of ten bits where those take longer. `baud` is in bits per second.
#[must_use]
pub fn gap(baud: u32) -> Duration {
    let characters = 35_000_000_u32.checked_div(baud).unwrap_or(u32::MAX);
    SHORTEST_GAP.max(Duration::from_micros(u64::from(characters)))
}

/// Finds the frames of direction `D` in a stream of bytes.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Deframer<D> {
    buffer: heapless::Vec<u8, MAX_LENGTH>,
    search: Search,
    gap: Duration,
    last_byte: Instant,
    direction: PhantomData<D>,
}

impl<D: Direction> Deframer<D> {
    /// A deframer with an empty buffer. `gap` comes from [`gap()`].
    #[must_use]
    pub const fn new(gap: Duration) -> Self {
        Self {
            buffer: heapless::Vec::new(),
            search: Search::START,
            gap,
            last_byte: Instant::ZERO,
            direction: PhantomData,
        }
    }

    /// Takes bytes that came since the last call, and returns how many. Offer the rest again after
    /// [`Deframer::pull`] has made room. After a timeout, no bytes are taken until `pull` has passed all bytes before the
    /// timeout.
    /// An empty slice states that the line is silent at `now` and that no byte waits anywhere.
    pub fn push(&mut self, now: Instant, bytes: &[u8]) -> usize {
        if bytes.is_empty() {
            self.note_silence(now);
            return 0;
        }
        self.last_byte = now;
        if self.search.has_pending_timeout() {
            // Only one timeout can be recorded; pull first.
            return 0;
        }
        if self.search.finished() == self.buffer.len() {
            self.buffer.clear();
            self.search = Search::START;
        } else if self.buffer.len() + bytes.len() > MAX_LENGTH {
            self.discard();
        }
        let room = MAX_LENGTH - self.buffer.len();
        let taken = bytes.get(..room).unwrap_or(bytes);
        // Pieces are short, so copying words inline is cheaper than a call. No copy can fail: `taken` fits the room.
        let (words, rest) = taken.as_chunks::<4>();
        for word in words {
            let _ = self.buffer.extend_from_slice(word);
        }
        for &byte in rest {
            let _ = self.buffer.push(byte);
        }
        taken.len()
    }

    /// Records that a byte was damaged or lost behind all bytes so far. As after a timeout, no frame continues across this
    /// place, complete frames before it come out, and nothing is taken until [`Deframer::pull`] has passed it.
    pub fn break_off(&mut self) {
        let end = self.buffer.len();
        if self.search.finished() < end {
            self.search.note_gap(end);
            self.search.note_timeout(end);
        }
    }

    /// The next frame or defect; `None` if the bytes so far hold no more. Call it until it returns `None`.
    pub fn pull(&mut self) -> Option<Result<Frame<'_>, Defect>> {
        self.search.next::<D>(&self.buffer)
    }

    /// When continued silence has an effect. The shell has to check the line at that time. `None` if silence has no
    /// effect.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        let end = self.buffer.len();
        if self.search.finished() >= end {
            None
        } else if self.search.has_gap_at(end) {
            Some(self.last_byte + ABANDON_AFTER)
        } else {
            Some(self.last_byte + self.gap)
        }
    }

    /// How many more bytes are needed before there is something to pull, unless the line becomes silent.
    #[must_use]
    pub fn wanted(&self) -> usize {
        self.search.wanted().saturating_sub(self.buffer.len())
    }

    fn note_silence(&mut self, now: Instant) {
        let silence = now - self.last_byte;
        if silence >= self.gap {
            self.search.note_gap(self.buffer.len());
        }
        if silence >= ABANDON_AFTER {
            self.search.note_timeout(self.buffer.len());
        }
    }

    /// Moves the unfinished bytes to the front of the buffer.
    fn discard(&mut self) {
        let finished = self.search.finished();
        let left = self.buffer.len().saturating_sub(finished);
        for to in 0..left {
            if let Some(&byte) = self.buffer.get(finished + to)
                && let Some(slot) = self.buffer.get_mut(to)
            {
                *slot = byte;
            }
        }
        self.buffer.truncate(left);
        self.search.forget(finished);
    }
}
