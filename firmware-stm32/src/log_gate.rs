//! When the main loop may write a line of its log. The log masks all interrupts for a whole line, longer than a byte lasts at
//! 1 Mbaud, so the line is written only while both serial lines are idle. With a debugger attached it is written at once.

use protocol_core::time::{Duration, Instant};

/// A serial line is idle after this time without a byte: longer than a servo waits before it answers.
const QUIET: Duration = Duration::from_millis(1);

/// Keeps the time of the last byte.
#[derive(Clone, Copy, Debug)]
pub struct LogGate {
    last_byte: Instant,
}

impl LogGate {
    /// A gate that counts a byte at `now`, so it stays closed for the quiet time.
    #[must_use]
    pub const fn new(now: Instant) -> Self {
        Self { last_byte: now }
    }

    /// Records that bytes were received or sent at `now`.
    pub const fn note_bytes(&mut self, now: Instant) {
        self.last_byte = now;
    }

    /// True if a log line may be written at `now`.
    #[must_use]
    pub fn is_open(&self, now: Instant, is_sending: bool, has_debugger: bool) -> bool {
        has_debugger || (!is_sending && now - self.last_byte >= QUIET)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    #[test]
    fn a_line_is_logged_only_after_a_pause() {
        let mut gate = LogGate::new(at(0));
        assert!(!gate.is_open(at(999), false, false) && gate.is_open(at(1_000), false, false));
        gate.note_bytes(at(5_000));
        assert!(!gate.is_open(at(5_000), false, false) && !gate.is_open(at(5_999), false, false));
        assert!(gate.is_open(at(6_000), false, false));
        assert!(!gate.is_open(at(6_000), true, false), "queued bytes are still to be sent");
    }

    #[test]
    fn with_a_debugger_the_log_goes_first() {
        assert!(LogGate::new(at(0)).is_open(at(0), true, true));
    }
}
