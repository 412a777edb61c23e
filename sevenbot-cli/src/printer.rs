//! What commands show: facts as text or as JSON on standard output, everything else on standard error.
//!
//! ```text
//!   sevenbot get speed.1           32  speed.1   60  114.0 °/s
//!   sevenbot get speed.1 --json    {"registers":[{"address":32,"name":"speed.1",...}]}
//! ```
//!
//! One JSON value a line. Colours go to terminals only: anstream takes them out of anything else, and where
//! NO_COLOR is set.

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};

use serde::Serialize;

use crate::command_error::CommandError;
use crate::style::{BOLD, WARNING};

/// Something found out: its fields as serde names them, or lines for a reader.
pub(crate) trait Printable: Serialize {
    /// Writes the lines.
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()>;
}

/// Where facts are shown.
pub(crate) struct Printer {
    json: bool,
    stream: Box<dyn Write>,
}

impl Printer {
    pub(crate) fn stdout(json: bool) -> Self {
        Self { json, stream: Box::new(anstream::stdout()) }
    }

    /// Is JSON wanted?
    pub(crate) const fn is_json(&self) -> bool {
        self.json
    }

    /// Will a person see it in a terminal?
    pub(crate) fn is_terminal(&self) -> bool {
        !self.json && io::stdout().is_terminal()
    }

    /// Shows facts.
    pub(crate) fn print(&mut self, facts: &impl Printable) -> Result<(), CommandError> {
        if self.json {
            let line = serde_json::to_string(facts).map_err(io::Error::from)?;
            writeln!(self.stream, "{line}")?;
        } else {
            facts.write_text(&mut self.stream)?;
        }
        Ok(self.stream.flush()?)
    }

    /// Shows text as it is, whether JSON is wanted or not: a generated file.
    pub(crate) fn print_raw(&mut self, text: &[u8]) -> Result<(), CommandError> {
        self.stream.write_all(text)?;
        Ok(self.stream.flush()?)
    }
}

/// Something the user should know besides the facts. Where even standard error is closed, nobody reads it.
pub(crate) fn note(message: impl Display) {
    let _ = writeln!(anstream::stderr(), "{BOLD}note:{BOLD:#} {message}");
}

/// Something that may not be what the user expects.
pub(crate) fn warn(message: impl Display) {
    let _ = writeln!(anstream::stderr(), "{WARNING}warning:{WARNING:#} {message}");
}
