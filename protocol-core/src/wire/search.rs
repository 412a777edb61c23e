//! The search for frames in the bytes of a stream, and how far it has come (D3, D4).
//!
//! ```text
//!    0        head      scan_pos             gap_end          bytes.len()
//!    ├──────────┼──────────┼───────────────────┼────────────────┤
//!      finished   the frame   searched once the
//!                 at the head  line was silent
//!                 is incomplete  up to gap_end
//! ```
//!
//! The deframer appends no bytes until the search has passed a timeout. So a timeout that is not passed is at the end of
//! the bytes.
//!
//! This file handles positions only. The deframer owns the bytes, and appends to them between two calls of the search.

use super::frame::{Defect, Direction, Frame, HEADER, MIN_LENGTH, ParseOutcome, parse};

/// The state of the search. All fields are positions in the buffer.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Search {
    /// The search is finished with all bytes before the head.
    head: usize,
    /// The search has no new result before the buffer has this length.
    wanted: usize,
    /// Length of the buffer when the line was last silent for the gap.
    gap_end: usize,
    /// Length of the buffer at the last timeout. No frame continues across it.
    timeout_end: usize,
    /// Where the search behind an incomplete head continues.
    scan_pos: usize,
    /// The search behind an incomplete head has evaluated every frame that ends up to here.
    evaluated_end: usize,
}

impl Search {
    /// The search in an empty buffer.
    pub(super) const START: Self =
        Self { head: 0, wanted: MIN_LENGTH, gap_end: 0, timeout_end: 0, scan_pos: 0, evaluated_end: 0 };

    /// How many bytes before the head can be dropped.
    pub(super) const fn finished(&self) -> usize {
        self.head
    }

    /// How many bytes the buffer needs before there is a new result.
    pub(super) const fn wanted(&self) -> usize {
        self.wanted
    }

    /// Is there a timeout that the search has not passed yet?
    pub(super) const fn has_pending_timeout(&self) -> bool {
        self.head < self.timeout_end
    }

    /// Was the line silent for the gap after `end` bytes?
    pub(super) const fn has_gap_at(&self, end: usize) -> bool {
        self.gap_end >= end
    }

    /// Records that the line was silent for the gap after `end` bytes.
    pub(super) const fn note_gap(&mut self, end: usize) {
        // While a scan is unfinished, `gap_end` must stay. The first call after the scan records the new gap.
        if self.gap_end < end && self.evaluated_end >= self.gap_end {
            self.gap_end = end;
            self.scan_pos = self.head;
            self.wanted = 0;
        }
    }

    /// Records a timeout after `end` bytes.
    pub(super) const fn note_timeout(&mut self, end: usize) {
        if self.timeout_end < end {
            self.timeout_end = end;
            self.wanted = 0;
        }
    }

    /// Adjusts all positions after the first `count` bytes were removed.
    pub(super) fn forget(&mut self, count: usize) {
        for position in [
            &mut self.head,
            &mut self.wanted,
            &mut self.gap_end,
            &mut self.timeout_end,
            &mut self.scan_pos,
            &mut self.evaluated_end,
        ] {
            *position = position.saturating_sub(count);
        }
    }

    /// Searches for the next frame or defect to report; `None` if that needs more bytes.
    pub(super) fn next<'a, D: Direction>(&mut self, bytes: &'a [u8]) -> Option<Result<Frame<'a>, Defect>> {
        while bytes.len() >= self.wanted {
            let found =
                if self.gap_end == 0 { self.step::<D>(bytes) } else { self.step_after_gap::<D>(bytes) };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Parses at the head while no gap is recorded.
    #[inline(never)]
    fn step<'a, D: Direction>(&mut self, bytes: &'a [u8]) -> Option<Result<Frame<'a>, Defect>> {
        let at = self.head;
        match parse::<D>(bytes.get(at..).unwrap_or_default()) {
            ParseOutcome::Incomplete(length) => {
                self.wanted = at + length;
                None
            }
            ParseOutcome::Complete(frame, length) => {
                let end = at + length;
                self.head = end - header_bytes_before(bytes, end);
                self.wanted = self.head + MIN_LENGTH;
                Some(Ok(frame))
            }
            ParseOutcome::Defective(defect, _) => {
                self.head = next_header(bytes, at + 1);
                Some(Err(defect))
            }
            ParseOutcome::NotAFrame => {
                self.head = next_header(bytes, at + 1);
                None
            }
        }
    }

    /// Parses at the head, or behind it, once a gap is recorded.
    #[inline(never)]
    fn step_after_gap<'a, D: Direction>(&mut self, bytes: &'a [u8]) -> Option<Result<Frame<'a>, Defect>> {
        let at = self.head;
        let limit = if at < self.timeout_end { self.timeout_end } else { bytes.len() };
        match parse::<D>(bytes.get(at..limit).unwrap_or_default()) {
            ParseOutcome::Incomplete(_) if at < self.timeout_end => self.head = next_header(bytes, at + 1),
            ParseOutcome::Incomplete(_) if self.evaluated_end < self.gap_end => {
                return self.scan_behind_head::<D>(bytes);
            }
            ParseOutcome::Incomplete(length) => self.wanted = at + length,
            outcome => {
                self.head = position_after(bytes, at, outcome);
                return self.report(at, outcome);
            }
        }
        None
    }

    /// Searches for complete frames between the incomplete head and the gap.
    ///
    /// The bytes may be data of the head's frame, so a wrong CRC among them is not reported here. It is reported once
    /// the head has failed and the search passes the bytes again.
    #[inline(never)]
    fn scan_behind_head<'a, D: Direction>(&mut self, bytes: &'a [u8]) -> Option<Result<Frame<'a>, Defect>> {
        loop {
            let at = self.scan_pos.max(self.head + 1);
            if at >= self.gap_end {
                self.evaluated_end = self.gap_end;
                return None;
            }
            let outcome = parse::<D>(bytes.get(at..self.gap_end).unwrap_or_default());
            let is_damage = matches!(outcome, ParseOutcome::Defective(Defect::WrongCrc, _));
            let found = if is_damage { None } else { self.report(at, outcome) };
            self.scan_pos = position_after(bytes, at, outcome);
            if found.is_some() {
                return found;
            }
        }
    }

    /// The frame or defect to report, unless the scan behind an incomplete head has reported it.
    fn report<'a>(&self, at: usize, outcome: ParseOutcome<'a>) -> Option<Result<Frame<'a>, Defect>> {
        let (found, length) = match outcome {
            ParseOutcome::Complete(frame, length) => (Ok(frame), length),
            ParseOutcome::Defective(Defect::MalformedRange { address }, length) => {
                (Err(Defect::MalformedRange { address }), length)
            }
            ParseOutcome::Defective(Defect::WrongCrc, _) => return Some(Err(Defect::WrongCrc)),
            ParseOutcome::Incomplete(_) | ParseOutcome::NotAFrame => return None,
        };
        if self.is_reported(at, at + length) { None } else { Some(found) }
    }

    /// Has the scan behind an incomplete head evaluated the frame from `at` to `end`?
    const fn is_reported(&self, at: usize, end: usize) -> bool {
        end <= self.evaluated_end || (at < self.scan_pos && end <= self.gap_end)
    }
}

/// Where the search continues after the `outcome` of parsing at `at`.
fn position_after(bytes: &[u8], at: usize, outcome: ParseOutcome<'_>) -> usize {
    match outcome {
        ParseOutcome::Complete(_, length) => at + length - header_bytes_before(bytes, at + length),
        _ => next_header(bytes, at + 1),
    }
}

/// The first position from `at` on where a header may begin, or the end of `bytes`.
fn next_header(bytes: &[u8], at: usize) -> usize {
    let rest = bytes.get(at..).unwrap_or(&[]);
    at + rest.iter().position(|&byte| byte == HEADER[0]).unwrap_or(rest.len())
}

/// How many bytes before `end` may belong to the header of the next frame.
fn header_bytes_before(bytes: &[u8], end: usize) -> usize {
    let Some([.., before, last]) = bytes.get(..end) else { return 0 };
    match [*before, *last] {
        HEADER => 2,
        [_, last] if last == HEADER[0] => 1,
        _ => 0,
    }
}
