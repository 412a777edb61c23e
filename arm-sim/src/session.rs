//! A recorded session: the inputs of an arm, and the bytes that the host took from the line, with virtual times.
//!
//! ```text
//!   7bot-session 1 program=3.0.0 controller=sevenbot seed=1 chip-id=53494d000001 paced=true ...
//!   settings 79b8f899...                      the bytes of the settings, without erased ones at the end
//!   1000000 > aa7703360781ce                  at 1 s: the host starts to send these bytes
//!   1002430 ~                                 time passes until then, and the host is idle
//!   1002430 < aa770336075a5a415a5a5a50....    the host takes these bytes
//!   1003000 =                                 time passes until then, and the host may have sent more
//!   2000000 ! fault 3=missing                 an action
//! ```
//!
//! Times are microseconds since power-up. Every call that lets time pass is recorded, because an idle host line has a
//! meaning ([D4](protocol_core::decisions#d4)). A [`Replay`](crate::replay::Replay) repeats the same inputs on a new arm,
//! compares the bytes that this arm sends, and reports the first difference.

use alloc::vec::Vec;
use core::fmt::{self, Debug, Display, Formatter};
use core::num::ParseIntError;

use protocol_core::time::Instant;

use crate::action::Action;

mod header;

pub use header::{ControllerKind, HeaderError, SessionHeader};

/// The version of the format: the second word of a session. Sessions of other versions are refused.
pub const VERSION: u32 = 1;

/// Receives the entries of a session while it is recorded.
pub trait SessionRecorder: Debug + Send {
    /// Adds an entry. Entries come in the order of their times.
    fn add(&mut self, entry: &Entry);
}

/// The event of an [`Entry`]. In its line the events have the marks `>`, `~` or `=`, `<` and `!`.
#[derive(Clone, Debug, PartialEq)]
pub enum SessionEvent {
    /// The host started to send these bytes.
    Sent(Vec<u8>),
    /// Time passed. `true`: the host was known to be idle.
    Advanced(bool),
    /// The host took these bytes off the line.
    Taken(Vec<u8>),
    /// An action was carried out on the arm.
    Acted(Action),
}

/// Something that happened to an arm: a line of a session.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// When it happened, counted from power-up.
    pub now: Instant,
    /// The rest of the line, after the time.
    pub event: SessionEvent,
}

/// The line is not an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("use MICROSECONDS and then '> HEX', '< HEX', '~', '=' or '! ACTION'")]
pub struct NoEntry;

impl core::str::FromStr for Entry {
    type Err = NoEntry;

    fn from_str(line: &str) -> Result<Self, NoEntry> {
        let mut words = line.splitn(3, ' ');
        let mut word = || words.next().ok_or(NoEntry);
        let now = Instant::from_micros(word()?.parse().map_err(|_| NoEntry)?);
        let kind = word()?;
        let content = if matches!(kind, "~" | "=") { "" } else { word()? };
        let event = match kind {
            "~" => SessionEvent::Advanced(true),
            "=" => SessionEvent::Advanced(false),
            ">" => SessionEvent::Sent(bytes_from_hex(content).map_err(|_| NoEntry)?),
            "<" => SessionEvent::Taken(bytes_from_hex(content).map_err(|_| NoEntry)?),
            "!" => SessionEvent::Acted(content.parse().map_err(|_| NoEntry)?),
            _ => return Err(NoEntry),
        };
        Ok(Self { now, event })
    }
}

impl Display for Entry {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        write!(out, "{} ", self.now.as_micros())?;
        match &self.event {
            SessionEvent::Sent(bytes) => write!(out, "> {}", Hex(bytes)),
            SessionEvent::Advanced(is_idle) => out.write_str(if *is_idle { "~" } else { "=" }),
            SessionEvent::Taken(bytes) => write!(out, "< {}", Hex(bytes)),
            SessionEvent::Acted(action) => write!(out, "! {action}"),
        }
    }
}

pub(crate) struct Hex<'a>(pub(crate) &'a [u8]);

impl Display for Hex<'_> {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(out, "{byte:02x}"))
    }
}

fn bytes_from_hex(digits: &str) -> Result<Vec<u8>, ParseIntError> {
    let pairs = digits.as_bytes().chunks(2);
    pairs.map(|pair| u8::from_str_radix(core::str::from_utf8(pair).unwrap_or("x"), 16)).collect()
}
