//! Pieces of a stream in, whole frames out: loses its place in the stream and finds it again (D3, D4).
//!
//! ```text
//!      done with      the head: first byte that
//!                     may begin a frame
//!   ┌───────────────┬──────────────────────────────────────────────┐
//!   │ . . . . . . . │ AA 77 06 10 FF  ..  AA 77 03 36 07 81 CE  .. │ ◀── push
//!   └───────────────┴──────────────────────────────────────────────┘
//!                     ╰─ unfinished: claims   ╰─ whole: comes out once the line
//!                        262 bytes               has been silent for the gap
//! ```
//!
//! * A frame at the head comes out as soon as its last byte is there.
//! * Behind a head that turns out not to be a frame, the search goes on with the very next byte.
//! * Behind an unfinished head, whole frames come out after a short silence (the gap), and the head goes
//!   on waiting; after a long one ([`ABANDON_AFTER`]) it is given up. So a false header in noise holds up
//!   nothing for longer than the gap, and a sender that pauses inside a frame loses nothing.
//! * A frame whose last byte could be the first of a header lends it to the next one: a frame that lost
//!   its own last byte and was completed by the next frame's first does not take that frame with it.
//!
//! Silence has to be seen. Bytes that wait outside (in a driver's queue, in the kernel) came at a time
//! nobody knows, so only an empty [`Deframer::push`], which says that nothing waits, lets time pass here. A
//! shell that was held up for a second therefore never mistakes its own pause for the sender's.

use core::marker::PhantomData;

use super::frame::{Defect, Direction, Frame, MAX_LENGTH};
use super::search::Search;
use crate::time::{Duration, Instant};

/// The shortest gap that lets whole frames pass an unfinished one (D4).
const SHORTEST_GAP: Duration = Duration::from_millis(2);
/// Silence after which an unfinished frame is given up (D4).
pub const ABANDON_AFTER: Duration = Duration::from_millis(100);

/// The silence after which whole frames may pass an unfinished one: 2 ms, or three and a half characters
/// of ten bits where those take longer (D4). `baud` is in bits per second.
#[must_use]
pub fn gap(baud: u32) -> Duration {
    let characters = 35_000_000_u32.checked_div(baud).unwrap_or(u32::MAX);
    SHORTEST_GAP.max(Duration::from_micros(u64::from(characters)))
}

/// Finds the frames that go in direction `D` in a stream of bytes.
#[derive(Clone, Debug)]
pub struct Deframer<D> {
    buffer: heapless::Vec<u8, MAX_LENGTH>,
    search: Search,
    gap: Duration,
    last_byte: Instant,
    direction: PhantomData<D>,
}

impl<D: Direction> Deframer<D> {
    /// A deframer that has seen nothing yet. `gap` is the silence of [`gap()`].
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

    /// Takes bytes that came since the last call, and says how many; the rest has to be offered again
    /// after [`Deframer::pull`] has made room, or, behind a long silence, has looked at what came before it.
    /// An empty slice says that the line is silent as of `now`: nothing came and nothing waits anywhere.
    pub fn push(&mut self, now: Instant, bytes: &[u8]) -> usize {
        if bytes.is_empty() {
            self.note_silence(now);
            return 0;
        }
        self.last_byte = now;
        if self.search.is_cut() {
            // There is one mark for a long silence, and nobody has looked at what came before it yet.
            return 0;
        }
        if self.search.done() == self.buffer.len() {
            self.buffer.clear();
            self.search = Search::START;
        } else if self.buffer.len() + bytes.len() > MAX_LENGTH {
            self.discard();
        }
        let room = MAX_LENGTH - self.buffer.len();
        let taken = bytes.get(..room).unwrap_or(bytes);
        // Pieces are short: words in line cost less than a call to copy them. None can fail: they were cut to fit.
        let (words, rest) = taken.as_chunks::<4>();
        for word in words {
            let _ = self.buffer.extend_from_slice(word);
        }
        for &byte in rest {
            let _ = self.buffer.push(byte);
        }
        taken.len()
    }

    /// The next frame, or the next thing that looked like one and was not; `None` once there is nothing
    /// more to say about the bytes so far. Call it until then.
    pub fn pull(&mut self) -> Option<Result<Frame<'_>, Defect>> {
        self.search.next::<D>(&self.buffer)
    }

    /// When silence on the line would change something: the shell should look at the line by then.
    /// `None` if no silence, however long, would.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        let end = self.buffer.len();
        if self.search.done() >= end {
            None
        } else if self.search.is_quiet(end) {
            Some(self.last_byte + ABANDON_AFTER)
        } else {
            Some(self.last_byte + self.gap)
        }
    }

    /// How many more bytes have to come before there is anything new to pull, unless the line falls silent.
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
            self.search.note_cut(self.buffer.len());
        }
    }

    /// Moves the bytes that still count to the front of the buffer.
    fn discard(&mut self) {
        let done = self.search.done();
        let left = self.buffer.len().saturating_sub(done);
        for to in 0..left {
            if let Some(&byte) = self.buffer.get(done + to)
                && let Some(slot) = self.buffer.get_mut(to)
            {
                *slot = byte;
            }
        }
        self.buffer.truncate(left);
        self.search.forget(done);
    }
}
