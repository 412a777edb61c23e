//! The last things that happened, for the report of a violation.

use std::collections::VecDeque;
use std::fmt::{self, Display, Write};

use protocol_core::time::Instant;

/// How many of each kind are kept.
const KEPT: usize = 40;
/// Bytes of a frame that are kept.
const SHOWN: usize = 64;

/// Something that happened.
#[derive(Clone, Debug)]
enum Note {
    Words(String),
    Bytes { what: &'static str, length: usize, bytes: [u8; SHOWN] },
}

/// Three rings, so that many frames do not push out what is rare.
#[derive(Clone, Debug, Default)]
pub(super) struct Notes {
    events: VecDeque<(Instant, Note)>,
    host: VecDeque<(Instant, Note)>,
    bus: VecDeque<(Instant, Note)>,
}

impl Notes {
    pub(super) fn event(&mut self, now: Instant, words: String) {
        push(&mut self.events, now, Note::Words(words));
    }

    pub(super) fn host(&mut self, now: Instant, what: &'static str, bytes: &[u8]) {
        push(&mut self.host, now, shorten(what, bytes));
    }

    pub(super) fn bus(&mut self, now: Instant, what: &'static str, bytes: &[u8]) {
        push(&mut self.bus, now, shorten(what, bytes));
    }
}

fn shorten(what: &'static str, bytes: &[u8]) -> Note {
    let mut kept = [0; SHOWN];
    kept.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
    Note::Bytes { what, length: bytes.len(), bytes: kept }
}

fn push(ring: &mut VecDeque<(Instant, Note)>, now: Instant, note: Note) {
    if ring.len() == KEPT {
        ring.pop_front();
    }
    ring.push_back((now, note));
}

impl Display for Note {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Words(words) => out.write_str(words),
            Self::Bytes { what, length, bytes } => {
                write!(out, "{what}")?;
                bytes.iter().take(*length).try_for_each(|byte| write!(out, " {byte:02x}"))?;
                out.write_str(if *length > SHOWN { " .." } else { "" })
            }
        }
    }
}

/// Seconds of virtual time.
pub(super) fn clock(at: Instant) -> String {
    let micros = at.as_micros();
    format!("{}.{:06} s", micros / 1_000_000, micros % 1_000_000)
}

impl Display for Notes {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut all: Vec<_> = self.events.iter().chain(&self.host).chain(&self.bus).collect();
        all.sort_by_key(|(at, _)| *at);
        for (at, note) in all {
            writeln!(out, "{:>20}  {note}", clock(*at))?;
        }
        out.write_char('\n')
    }
}
