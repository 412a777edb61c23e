//! Where the frames are in the bytes of a stream so far, and how far the search for them has come (D3, D4).
//!
//! Knows positions only: the bytes stand in the deframer's buffer, which grows at its end while the search goes on.

use super::frame::{Defect, Direction, Frame, HEADER, MIN_LENGTH, Verdict, judge};

/// How far the search has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// The head: everything before it is done with.
    head: usize,
    /// Nothing new can be said before there are this many bytes.
    wanted: usize,
    /// The line was silent for the gap when there were this many bytes.
    quiet: usize,
    /// The line was silent for so long that nothing goes on behind it, when there were this many bytes.
    cut: usize,
    /// The search behind an unfinished head goes on here.
    behind: usize,
    /// Whatever ends up to here was judged behind an unfinished head.
    judged: usize,
}

/// A frame, or something that looked like one and was not.
pub(super) type Found<'a> = Result<Frame<'a>, Defect>;

impl Search {
    /// Nothing was seen yet.
    pub(super) const START: Self =
        Self { head: 0, wanted: MIN_LENGTH, quiet: 0, cut: 0, behind: 0, judged: 0 };

    /// How many bytes are done with.
    pub(super) const fn done(&self) -> usize {
        self.head
    }

    /// How many bytes there have to be before anything new can be said.
    pub(super) const fn wanted(&self) -> usize {
        self.wanted
    }

    /// Is there a long silence that nobody has looked behind yet?
    pub(super) const fn is_cut(&self) -> bool {
        self.head < self.cut
    }

    /// Was the line silent for the gap when there were `end` bytes?
    pub(super) const fn is_quiet(&self, end: usize) -> bool {
        self.quiet >= end
    }

    /// Takes note that the line was silent for the gap when there were `end` bytes.
    pub(super) const fn note_gap(&mut self, end: usize) {
        // An unfinished search keeps its mark: a later call will note the silence again.
        if self.quiet < end && self.judged >= self.quiet {
            self.quiet = end;
            self.behind = self.head;
            self.wanted = 0;
        }
    }

    /// Takes note that nothing goes on behind the first `end` bytes.
    pub(super) const fn note_cut(&mut self, end: usize) {
        if self.cut < end {
            self.cut = end;
            self.wanted = 0;
        }
    }

    /// The search after the first `count` bytes were taken away.
    pub(super) fn forget(&mut self, count: usize) {
        for mark in [
            &mut self.head,
            &mut self.wanted,
            &mut self.quiet,
            &mut self.cut,
            &mut self.behind,
            &mut self.judged,
        ] {
            *mark = mark.saturating_sub(count);
        }
    }

    /// Goes on until there is something to say.
    pub(super) fn next<'a, D: Direction>(&mut self, bytes: &'a [u8]) -> Option<Found<'a>> {
        while bytes.len() >= self.wanted {
            let found =
                if self.quiet == 0 { self.step::<D>(bytes) } else { self.step_in_silence::<D>(bytes) };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Looks at the head, on a line that was not silent since.
    #[inline(never)]
    fn step<'a, D: Direction>(&mut self, bytes: &'a [u8]) -> Option<Found<'a>> {
        let at = self.head;
        match judge::<D>(bytes.get(at..).unwrap_or_default()) {
            Verdict::Unfinished(length) => {
                self.wanted = at + length;
                None
            }
            Verdict::Whole(frame, length) => {
                let end = at + length;
                self.head = end - lent_by(bytes, end);
                self.wanted = self.head + MIN_LENGTH;
                Some(Ok(frame))
            }
            Verdict::Defective(defect, _) => {
                self.head = next_header(bytes, at + 1);
                (defect != Defect::NoFrame).then_some(Err(defect))
            }
        }
    }

    /// Looks at the head, or behind it, among bytes that came before a silence.
    #[inline(never)]
    fn step_in_silence<'a, D: Direction>(&mut self, bytes: &'a [u8]) -> Option<Found<'a>> {
        let at = self.head;
        let limit = if at < self.cut { self.cut } else { bytes.len() };
        match judge::<D>(bytes.get(at..limit).unwrap_or_default()) {
            Verdict::Unfinished(_) if at < self.cut => self.head = next_header(bytes, at + 1),
            Verdict::Unfinished(_) if self.judged < self.quiet => return self.next_behind::<D>(bytes),
            Verdict::Unfinished(length) => self.wanted = at + length,
            verdict => {
                self.head = after(bytes, at, verdict);
                return self.news(at, verdict);
            }
        }
        None
    }

    /// Looks for whole frames behind the unfinished head, among the bytes before the silence.
    #[inline(never)]
    fn next_behind<'a, D: Direction>(&mut self, bytes: &'a [u8]) -> Option<Found<'a>> {
        loop {
            let at = self.behind.max(self.head + 1);
            if at >= self.quiet {
                self.judged = self.quiet;
                return None;
            }
            let verdict = judge::<D>(bytes.get(at..self.quiet).unwrap_or_default());
            let found = self.news(at, verdict);
            self.behind = after(bytes, at, verdict);
            if found.is_some() {
                return found;
            }
        }
    }

    /// What a verdict has to say to the outside, unless it was said before, behind an unfinished head.
    fn news<'a>(&self, at: usize, verdict: Verdict<'a>) -> Option<Found<'a>> {
        match verdict {
            Verdict::Whole(frame, length) if !self.is_known(at, at + length) => Some(Ok(frame)),
            Verdict::Defective(Defect::NoFrame, _) => None,
            Verdict::Defective(defect, length) if !self.is_known(at, at + length) => Some(Err(defect)),
            _ => None,
        }
    }

    /// Was the frame from `at` to `end` judged before, behind an unfinished head?
    const fn is_known(&self, at: usize, end: usize) -> bool {
        end <= self.judged || (at < self.behind && end <= self.quiet)
    }
}

/// Where the search goes on after the verdict on what begins at `at`.
fn after(bytes: &[u8], at: usize, verdict: Verdict<'_>) -> usize {
    match verdict {
        Verdict::Whole(_, length) => at + length - lent_by(bytes, at + length),
        _ => next_header(bytes, at + 1),
    }
}

/// The first place from `at` on where a header may begin, or the end.
fn next_header(bytes: &[u8], at: usize) -> usize {
    let rest = bytes.get(at..).unwrap_or(&[]);
    at + rest.iter().position(|&byte| byte == HEADER[0]).unwrap_or(rest.len())
}

/// How many bytes at the end of a frame may begin the next one.
fn lent_by(bytes: &[u8], end: usize) -> usize {
    let Some([.., before, last]) = bytes.get(..end) else { return 0 };
    match [*before, *last] {
        HEADER => 2,
        [_, last] if last == HEADER[0] => 1,
        _ => 0,
    }
}
