//! The last events of a world, for the report of a violation.

use std::collections::VecDeque;
use std::fmt::{self, Display, Write};

use protocol_core::time::Instant;

/// The largest number of entries in each ring.
const MAX_ENTRIES: usize = 40;
/// The largest number of bytes of a frame that an entry keeps.
const MAX_BYTES: usize = 64;

/// Three rings, so that frequent frames do not displace rare events.
#[derive(Debug, Default)]
pub(super) struct EventLog {
    events: Ring,
    host: Ring,
    bus: Ring,
}

/// The last entries of one kind. A new entry reuses the buffers of the oldest one, so that the frequent frames need no
/// allocation.
#[derive(Debug, Default)]
struct Ring {
    entries: VecDeque<LogEntry>,
}

#[derive(Debug, Default)]
struct LogEntry {
    at: Instant,
    text: String,
    /// The bytes of a frame, or the first of them.
    bytes: Vec<u8>,
    has_more: bool,
}

impl EventLog {
    pub(super) fn event(&mut self, now: Instant, text: String) {
        self.events.add(now, |entry| entry.text = text);
    }

    pub(super) fn host(&mut self, now: Instant, what: &str, bytes: &[u8]) {
        self.host.add(now, |entry| entry.set(what, bytes));
    }

    pub(super) fn bus(&mut self, now: Instant, what: &str, bytes: &[u8]) {
        self.bus.add(now, |entry| entry.set(what, bytes));
    }
}

impl Ring {
    fn add(&mut self, at: Instant, fill: impl FnOnce(&mut LogEntry)) {
        if self.entries.len() < MAX_ENTRIES {
            self.entries.push_back(LogEntry::default());
        } else {
            self.entries.rotate_left(1);
        }
        if let Some(last) = self.entries.back_mut() {
            last.at = at;
            fill(last);
        }
    }
}

impl LogEntry {
    fn set(&mut self, what: &str, bytes: &[u8]) {
        self.text.clear();
        self.text.push_str(what);
        self.bytes.clear();
        self.bytes.extend_from_slice(bytes.get(..MAX_BYTES).unwrap_or(bytes));
        self.has_more = bytes.len() > MAX_BYTES;
    }
}

/// Seconds of virtual time.
pub(super) fn seconds(at: Instant) -> String {
    let micros = at.as_micros();
    format!("{}.{:06} s", micros / 1_000_000, micros % 1_000_000)
}

impl Display for LogEntry {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{:>20}  {}", seconds(self.at), self.text)?;
        self.bytes.iter().try_for_each(|byte| write!(out, " {byte:02x}"))?;
        out.write_str(if self.has_more { " .." } else { "" })
    }
}

impl Display for EventLog {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { events, host, bus } = self;
        let mut all: Vec<_> = [events, host, bus].into_iter().flat_map(|ring| &ring.entries).collect();
        all.sort_by_key(|entry| entry.at);
        all.into_iter().try_for_each(|entry| writeln!(out, "{entry}"))?;
        out.write_char('\n')
    }
}
