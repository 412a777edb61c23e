//! The last things that happened, for the report of a violation.

use std::collections::VecDeque;
use std::fmt::{self, Display, Write};

use protocol_core::time::Instant;

/// How many of each kind are kept.
const KEPT: usize = 40;
/// Bytes of a frame that are kept.
const SHOWN: usize = 64;

/// Three rings, so that many frames do not push out what is rare.
#[derive(Debug, Default)]
pub(super) struct Notes {
    events: Ring,
    host: Ring,
    bus: Ring,
}

/// The last notes of a kind. Where a note was, the next is written: millions of frames are noted for each
/// that is read.
#[derive(Debug, Default)]
struct Ring {
    notes: VecDeque<Note>,
}

#[derive(Debug, Default)]
struct Note {
    at: Instant,
    words: String,
    /// What was on the line, or the first part of it.
    bytes: Vec<u8>,
    has_more: bool,
}

impl Notes {
    pub(super) fn event(&mut self, now: Instant, words: String) {
        self.events.add(now, |note| note.words = words);
    }

    pub(super) fn host(&mut self, now: Instant, what: &str, bytes: &[u8]) {
        self.host.add(now, |note| note.set(what, bytes));
    }

    pub(super) fn bus(&mut self, now: Instant, what: &str, bytes: &[u8]) {
        self.bus.add(now, |note| note.set(what, bytes));
    }
}

impl Ring {
    fn add(&mut self, at: Instant, fill: impl FnOnce(&mut Note)) {
        if self.notes.len() < KEPT {
            self.notes.push_back(Note::default());
        } else {
            self.notes.rotate_left(1);
        }
        if let Some(last) = self.notes.back_mut() {
            last.at = at;
            fill(last);
        }
    }
}

impl Note {
    fn set(&mut self, what: &str, bytes: &[u8]) {
        self.words.clear();
        self.words.push_str(what);
        self.bytes.clear();
        self.bytes.extend(bytes.iter().take(SHOWN));
        self.has_more = bytes.len() > SHOWN;
    }
}

/// Seconds of virtual time.
pub(super) fn clock(at: Instant) -> String {
    let micros = at.as_micros();
    format!("{}.{:06} s", micros / 1_000_000, micros % 1_000_000)
}

impl Display for Note {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:>20}  {}", clock(self.at), self.words)?;
        self.bytes.iter().try_for_each(|byte| write!(out, " {byte:02x}"))?;
        out.write_str(if self.has_more { " .." } else { "" })
    }
}

impl Display for Notes {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { events, host, bus } = self;
        let mut all: Vec<_> = [events, host, bus].into_iter().flat_map(|ring| &ring.notes).collect();
        all.sort_by_key(|note| note.at);
        all.into_iter().try_for_each(|note| writeln!(out, "{note}"))?;
        out.write_char('\n')
    }
}
