//! `get`: shows registers with address, name, value and meaning.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;
use serde_json::Value;
use sevenbot::names::{self, NameError, name_of_register};
use sevenbot::register_text::{RegisterEntry, entries, raw_entries};
use sevenbot::{Arm, Span};

use crate::command_error::CommandError;
use crate::printer::Printable;
use crate::register_parser::RegisterParser;
use crate::session::Session;

/// Help text about register names.
pub(crate) const NAMES: &str = "\
Register names are those of docs/registers.md, in any case, with - or _, and may
be shortened while they are unique. .3 selects joint 3. A number is an address,
A..B a range from one name or number to another.

Registers that only map 2.1 has are options (20), 61 to 66, 68 to 73 and 82 to
97. An arm with the maker's firmware 2.2 has none of them, and only this
project's firmware has options.";

/// Show registers.
#[derive(Debug, Args)]
#[command(after_help = format!("{NAMES}

Examples:
  sevenbot get target-position          all seven
  sevenbot get speed.3 motor-state 12
  sevenbot get --raw 54..60
  sevenbot get status-version..255 --json"))]
pub(crate) struct GetArgs {
    /// Names, numbers or ranges of registers.
    #[arg(required = true, value_name = "REGISTER", value_parser = RegisterParser(spans), hide_possible_values = true)]
    registers: Vec<Spans>,
    /// Show the bytes as they are.
    #[arg(long)]
    raw: bool,
}

/// Registers in one read or, for the whole map, in two.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Spans(Vec<Span>);

fn spans(text: &str) -> Result<Spans, NameError> {
    match names::parse(text) {
        // One frame cannot read all 256 registers.
        Err(NameError::TooLong) => {
            Ok(Spans(Span::new(0, u8::MAX).into_iter().chain([Span::one(u8::MAX)]).collect()))
        }
        parsed => parsed.map(|span| Spans(vec![span])),
    }
}

pub(crate) fn run(session: &mut Session, args: &GetArgs) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    let mut shown = Vec::new();
    for &span in args.registers.iter().flat_map(|Spans(spans)| spans) {
        if !args.raw {
            check_served(&arm, span)?;
        }
        let snapshot = arm.read_span(span)?;
        shown.extend(if args.raw { raw_entries(&snapshot) } else { entries(&snapshot) });
    }
    session.printer.print(&RegisterList::from(shown))
}

/// Fails if the arm has none of the registers.
fn check_served(arm: &Arm, span: Span) -> Result<(), CommandError> {
    if span.addresses().any(|address| arm.serves(address)) || span == Span::NONE {
        return Ok(());
    }
    Err(not_served(arm, span.address()))
}

/// The error for a register that the arm lacks.
pub(crate) fn not_served(arm: &Arm, address: u8) -> CommandError {
    let (version, name) = (arm.identity().version(), name_of_register(address));
    CommandError::Arm(format!("the arm's firmware {version} does not have register {address}, {name}"))
}

#[derive(Debug, Serialize)]
pub(crate) struct RegisterList {
    registers: Vec<RegisterLine>,
}

#[derive(Debug, Serialize)]
struct RegisterLine {
    address: u8,
    name: String,
    bytes: Vec<u8>,
    value: Value,
    meaning: String,
    #[serde(skip)]
    text: String,
}

impl From<Vec<RegisterEntry>> for RegisterList {
    fn from(entries: Vec<RegisterEntry>) -> Self {
        Self { registers: entries.into_iter().map(RegisterLine::from).collect() }
    }
}

impl From<RegisterEntry> for RegisterLine {
    fn from(entry: RegisterEntry) -> Self {
        let RegisterEntry { address, name, bytes, value: text, meaning } = entry;
        // A chip id and a raw byte (0x..) do not parse as a decimal number.
        let value = match (text.parse::<i32>(), bytes.as_slice()) {
            (Ok(number), _) => Value::from(number),
            (Err(_), [byte]) => Value::from(*byte),
            (Err(_), _) => Value::from(text.as_str()),
        };
        Self { address, name, bytes, value, meaning, text }
    }
}

/// One line per entry, in columns.
impl Printable for RegisterList {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        for RegisterLine { address, name, text, meaning, .. } in &self.registers {
            let line = format!("{address:>3}  {name:<24} {text:>5}  {meaning}");
            writeln!(out, "{}", line.trim_end())?;
        }
        Ok(())
    }
}
