//! A log of all bytes between a program and an arm, with times: the host's side of `host-sim --record`.
//!
//! ```text
//!   7bot-log 1 program=3.0.0 port=/dev/ttyUSB0 baud=115200 unix-time=1795474513
//!   12043 > aa77030008...      microseconds since the start: the program sent these bytes
//!   14377 < aa77030008...      the arm sent these
//! ```
//!
//! The lines after the first have the format of a recorded session ([`arm_sim::session`]). [`entries`] reads both kinds of
//! file.

use std::fmt;
use std::io::{self, Write};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use arm_sim::session::{Entry, SessionEvent};
use protocol_core::time;

use crate::error::PortError;
use crate::host_line::HostLine;

/// The first words of a log, and of a recorded session.
const HEADS: [&str; 2] = ["7bot-log 1", "7bot-session 1"];

/// A line to an arm that logs its bytes.
pub struct LoggedLine<L> {
    line: L,
    log: Box<dyn Write + Send>,
    start: Instant,
    /// Did a write of the log fail? Then the log has ended.
    is_full: bool,
}

impl<L: HostLine> LoggedLine<L> {
    /// Logs the bytes of a line. The first line of the log names `port` and `baud`.
    ///
    /// # Errors
    /// The log cannot be written.
    pub fn new(line: L, mut log: Box<dyn Write + Send>, port: &str, baud: u32) -> io::Result<Self> {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
        let (head, version) = (HEADS.first().unwrap_or(&""), env!("CARGO_PKG_VERSION"));
        writeln!(log, "{head} program={version} port={port} baud={baud} unix-time={unix}")?;
        let start = line.now();
        Ok(Self { line, log, start, is_full: false })
    }

    /// Adds a line. After an error the log ends, and the line goes on: a full disk does not stop an arm.
    fn add(&mut self, event: SessionEvent) {
        let micros = self.line.now().saturating_duration_since(self.start).as_micros();
        let now = time::Instant::from_micros(u64::try_from(micros).unwrap_or(u64::MAX));
        if !self.is_full {
            self.is_full =
                writeln!(self.log, "{}", Entry { now, event }).and_then(|()| self.log.flush()).is_err();
        }
    }
}

impl<L> fmt::Debug for LoggedLine<L> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("LoggedLine").field("start", &self.start).finish_non_exhaustive()
    }
}

impl<L: HostLine> HostLine for LoggedLine<L> {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.add(SessionEvent::Sent(bytes.to_vec()));
        self.line.send(bytes)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        let bytes = self.line.receive(timeout)?;
        if !bytes.is_empty() {
            self.add(SessionEvent::Taken(bytes.clone()));
        }
        Ok(bytes)
    }

    fn now(&self) -> Instant {
        self.line.now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.line.sleep(duration);
    }
}

/// Who sent the bytes of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// The program.
    Host,
    /// The arm: the bytes that the program received.
    Arm,
}

/// Bytes that one side sent, and when.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogEntry {
    /// Since the start of the log, or in a recorded session since power-up.
    pub time: Duration,
    /// The side that sent them: an entry never holds bytes of both.
    pub sender: Sender,
    /// The bytes, which need not be whole frames.
    pub bytes: Vec<u8>,
}

/// Does a text begin as a log or a recorded session?
#[must_use]
pub fn is_log(text: &[u8]) -> bool {
    HEADS.iter().any(|head| text.starts_with(head.as_bytes()))
}

/// The bytes in a log or a recorded session. Other entries of a session are left out.
///
/// # Errors
/// The number of the first line that is no entry.
pub fn entries(text: &str) -> Result<Vec<LogEntry>, usize> {
    let mut entries = Vec::new();
    for (number, line) in (1_usize..).zip(text.lines()).skip(1) {
        if line.starts_with("settings ") || line.is_empty() {
            continue;
        }
        let entry: Entry = line.parse().map_err(|_| number)?;
        let time = Duration::from_micros(entry.now.as_micros());
        match entry.event {
            SessionEvent::Sent(bytes) => entries.push(LogEntry { time, sender: Sender::Host, bytes }),
            SessionEvent::Taken(bytes) => entries.push(LogEntry { time, sender: Sender::Arm, bytes }),
            _ => {}
        }
    }
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Arm;
    use crate::arm_options::ArmOptions;
    use crate::simulated::{SharedSimulation, Simulation, SimulationConfig};
    use std::sync::{Arc, Mutex};

    #[derive(Clone, Default)]
    struct Memory(Arc<Mutex<Vec<u8>>>);

    impl Write for Memory {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().expect("no panic").write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_log_holds_what_both_sides_sent() {
        let memory = Memory::default();
        let simulation = SharedSimulation::new(Simulation::new(SimulationConfig::default()));
        let line = LoggedLine::new(simulation.line(), Box::new(memory.clone()), "simulated", 115_200)
            .expect("memory");
        let mut arm = Arm::over(Box::new(line), "simulated", ArmOptions::default()).expect("an arm");
        arm.positions().expect("an answer");
        let text = String::from_utf8(memory.0.lock().expect("no panic").clone()).expect("text");
        assert!(is_log(text.as_bytes()), "{text}");
        let entries = entries(&text).expect("entries");
        let sent = |sender| {
            let of = entries.iter().filter(|entry| entry.sender == sender);
            of.flat_map(|entry| entry.bytes.clone()).collect::<Vec<_>>()
        };
        assert!(sent(Sender::Host).starts_with(&[0xAA, 0x77, 3, 0, 8]), "{text}");
        assert!(sent(Sender::Arm).starts_with(&[0xAA, 0x77, 3, 0, 8, 7, 30]), "{text}");
        assert!(entries.is_sorted_by_key(|entry| entry.time));
    }

    #[test]
    fn a_line_that_is_no_entry_is_named() {
        assert_eq!(entries("7bot-log 1\n5 > aa\n\n7 x"), Err(4));
        assert_eq!(entries("7bot-session 1 a=b\nsettings aa\n5 ~\n6 ! fault 3=missing\n"), Ok(Vec::new()));
        assert_eq!(
            entries("7bot-session 1 a=b\nsettings aa\n5 ~\n9 < 00\n").map(|entries| entries.len()),
            Ok(1)
        );
    }
}
