//! The output of commands: results as text or JSON on standard output, notes and warnings on standard error.
//!
//! ```text
//!   sevenbot get speed.1           32  speed.1   60  114.0 °/s
//!   sevenbot get speed.1 --json    {"registers":[{"address":32,"name":"speed.1",...}]}
//! ```
//!
//! JSON has one value per line, on standard error too. anstream removes the colours if the output is not a terminal, or
//! NO_COLOR is set.

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use anstyle::Style;
use serde::Serialize;
use serde_json::json;

use crate::command_error::CommandError;
use crate::style::{BOLD, WARNING};

/// Are notes, warnings and errors JSON? Set once, before the command runs.
static IS_JSON: AtomicBool = AtomicBool::new(false);

/// The result of a command, as JSON (by serde) or as text.
pub(crate) trait Printable: Serialize {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()>;
}

pub(crate) struct Printer {
    json: bool,
    stream: Box<dyn Write>,
}

impl Printer {
    pub(crate) fn stdout(json: bool) -> Self {
        IS_JSON.store(json, Ordering::Relaxed);
        Self { json, stream: Box::new(anstream::stdout()) }
    }

    pub(crate) const fn is_json(&self) -> bool {
        self.json
    }

    /// Is the output text on a terminal?
    pub(crate) fn is_terminal(&self) -> bool {
        !self.json && io::stdout().is_terminal()
    }

    /// Prints a result: with `--json` as one line of JSON, otherwise as text.
    pub(crate) fn print(&mut self, facts: &impl Printable) -> Result<(), CommandError> {
        if self.json {
            let line = serde_json::to_string(facts).map_err(io::Error::from)?;
            writeln!(self.stream, "{line}")?;
        } else {
            facts.write_text(&mut self.stream)?;
        }
        Ok(self.stream.flush()?)
    }

    /// Prints text, also with `--json`. If the output is not a terminal, escape sequences are removed.
    pub(crate) fn print_raw(&mut self, text: &[u8]) -> Result<(), CommandError> {
        self.stream.write_all(text)?;
        Ok(self.stream.flush()?)
    }
}

/// Prints a note. Ignores a closed standard error.
pub(crate) fn note(message: impl Display) {
    tell("note", BOLD, &message);
}

pub(crate) fn warn(message: impl Display) {
    tell("warning", WARNING, &message);
}

fn tell(kind: &str, style: Style, message: &dyn Display) {
    let mut err = anstream::stderr();
    let _ = match IS_JSON.load(Ordering::Relaxed) {
        true => writeln!(err, "{}", json!({ kind: message.to_string() })),
        false => writeln!(err, "{style}{kind}:{style:#} {message}"),
    };
}
