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
use core::ops::Range;

use super::frame::{Defect, Direction, Frame, HEADER, MAX_LENGTH, Verdict, judge};
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
    /// The head: everything before it is done with.
    head: usize,
    /// Nothing new can be said before the buffer is this long.
    wanted: usize,
    /// The line was silent for the gap when the buffer was this long.
    quiet: usize,
    /// The line was silent for [`ABANDON_AFTER`] when the buffer was this long.
    cut: usize,
    /// The search behind an unfinished head goes on here.
    behind: usize,
    /// Whatever ends up to here was judged behind an unfinished head.
    judged: usize,
    gap: Duration,
    last_byte: Instant,
    direction: PhantomData<D>,
}

/// What the search came upon.
enum Found {
    Frame(Range<usize>),
    Defect(Defect),
}

impl<D: Direction> Deframer<D> {
    /// A deframer that has seen nothing yet. `gap` is the silence of [`gap()`].
    #[must_use]
    pub const fn new(gap: Duration) -> Self {
        Self {
            buffer: heapless::Vec::new(),
            head: 0,
            wanted: 0,
            quiet: 0,
            cut: 0,
            behind: 0,
            judged: 0,
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
        if self.head < self.cut {
            // There is one mark for a long silence, and nobody has looked at what came before it yet.
            return 0;
        }
        if self.buffer.len() + bytes.len() > MAX_LENGTH {
            self.discard();
        }
        let room = MAX_LENGTH - self.buffer.len();
        let taken = bytes.get(..room).unwrap_or(bytes);
        // Cannot fail: it was cut to fit.
        let _ = self.buffer.extend_from_slice(taken);
        taken.len()
    }

    /// The next frame, or the next thing that looked like one and was not; `None` once there is nothing
    /// more to say about the bytes so far. Call it until then.
    pub fn pull(&mut self) -> Option<Result<Frame<'_>, Defect>> {
        match self.search()? {
            Found::Defect(defect) => Some(Err(defect)),
            Found::Frame(place) => Frame::of_judged(self.buffer.get(place)?).map(Ok),
        }
    }

    /// When silence on the line would change something: the shell should look at the line by then.
    /// `None` if no silence, however long, would.
    #[must_use]
    pub fn deadline(&self) -> Option<Instant> {
        let end = self.buffer.len();
        if self.head >= end {
            None
        } else if self.quiet < end {
            Some(self.last_byte + self.gap)
        } else {
            Some(self.last_byte + ABANDON_AFTER)
        }
    }

    fn note_silence(&mut self, now: Instant) {
        let silence = now - self.last_byte;
        let end = self.buffer.len();
        // An unfinished search keeps its mark: a later call will note the silence again.
        if silence >= self.gap && self.quiet < end && self.judged >= self.quiet {
            self.quiet = end;
            self.behind = self.head;
            self.wanted = 0;
        }
        if silence >= ABANDON_AFTER && self.cut < end {
            self.cut = end;
            self.wanted = 0;
        }
    }

    /// Looks at the head until there is something to say.
    fn search(&mut self) -> Option<Found> {
        while self.buffer.len() >= self.wanted.max(self.head + 1) {
            let at = self.head;
            match self.verdict(at, self.limit(at)) {
                Verdict::Unfinished(_) if at < self.cut => self.head = self.next_header(at + 1),
                Verdict::Unfinished(_) if self.judged < self.quiet => {
                    if let Some(found) = self.search_behind() {
                        return Some(found);
                    }
                }
                Verdict::Unfinished(length) => {
                    self.wanted = at + length;
                    return None;
                }
                verdict => {
                    self.head = self.after(at, verdict);
                    if let Some(found) = self.news(at, verdict) {
                        return Some(found);
                    }
                }
            }
        }
        self.start_over_if_empty();
        None
    }

    /// Looks for whole frames behind the unfinished head, among the bytes before the silence.
    fn search_behind(&mut self) -> Option<Found> {
        loop {
            let at = self.behind.max(self.head + 1);
            if at >= self.quiet {
                self.judged = self.quiet;
                return None;
            }
            let verdict = self.verdict(at, self.quiet);
            let found = self.news(at, verdict);
            self.behind = self.after(at, verdict);
            if found.is_some() {
                return found;
            }
        }
    }

    /// Where the search goes on after the verdict on what begins at `at`.
    fn after(&self, at: usize, verdict: Verdict) -> usize {
        match verdict {
            Verdict::Whole(length) => at + length - self.lent_by(at + length),
            _ => self.next_header(at + 1),
        }
    }

    /// What a verdict has to say to the outside, unless it was said before, behind an unfinished head.
    fn news(&self, at: usize, verdict: Verdict) -> Option<Found> {
        match verdict {
            Verdict::Whole(length) if !self.is_known(at, at + length) => Some(Found::Frame(at..at + length)),
            Verdict::Defective(Defect::NoFrame, _) => None,
            Verdict::Defective(defect, length) if !self.is_known(at, at + length) => {
                Some(Found::Defect(defect))
            }
            _ => None,
        }
    }

    /// Was the frame from `at` to `end` judged before, behind an unfinished head?
    fn is_known(&self, at: usize, end: usize) -> bool {
        end <= self.judged || (at < self.behind && end <= self.quiet)
    }

    /// Where the bytes end that may belong to a frame beginning at `at`: none goes on after a long silence.
    fn limit(&self, at: usize) -> usize {
        if at < self.cut { self.cut } else { self.buffer.len() }
    }

    fn verdict(&self, at: usize, limit: usize) -> Verdict {
        judge::<D>(self.buffer.get(at..limit).unwrap_or(&[]))
    }

    /// The first place from `at` on where a header may begin, or the end.
    fn next_header(&self, at: usize) -> usize {
        let rest = self.buffer.get(at..).unwrap_or(&[]);
        at + rest.iter().position(|&byte| byte == HEADER[0]).unwrap_or(rest.len())
    }

    /// How many bytes at the end of a frame may begin the next one.
    fn lent_by(&self, end: usize) -> usize {
        match self.buffer.get(..end) {
            Some([.., last]) if *last == HEADER[0] => 1,
            Some([.., first, second]) if [*first, *second] == HEADER => 2,
            _ => 0,
        }
    }

    fn start_over_if_empty(&mut self) {
        if self.head >= self.buffer.len() {
            self.discard();
        }
    }

    /// Moves the bytes that still count to the front of the buffer.
    fn discard(&mut self) {
        let done = self.head;
        let left = self.buffer.len().saturating_sub(done);
        for to in 0..left {
            if let Some(&byte) = self.buffer.get(done + to)
                && let Some(slot) = self.buffer.get_mut(to)
            {
                *slot = byte;
            }
        }
        self.buffer.truncate(left);
        for mark in [
            &mut self.head,
            &mut self.wanted,
            &mut self.quiet,
            &mut self.cut,
            &mut self.behind,
            &mut self.judged,
        ] {
            *mark = mark.saturating_sub(done);
        }
    }
}
