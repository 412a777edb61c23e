//! `registers`: the table that both ends of the wire are built from, for readers and for other languages.

use clap::{Args, ValueEnum};
use sevenbot::table;

use crate::failure::Failure;
use crate::session::Session;

/// Print the register table: it needs no arm.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot registers
  sevenbot registers --format c > sevenbot_registers.h
  sevenbot registers --format python > sevenbot_registers.py")]
pub(crate) struct RegistersArgs {
    /// What to write it as.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// Columns.
    Text,
    /// The table of docs/registers.md.
    Markdown,
    /// One array; also --json.
    Json,
    /// A header for C and C++.
    C,
    /// A module.
    Python,
}

pub(crate) fn run(session: &mut Session, args: &RegistersArgs) -> Result<(), Failure> {
    let format = if session.output.is_json() { Format::Json } else { args.format };
    let text = match format {
        Format::Text => table::text(),
        Format::Markdown => table::markdown(),
        Format::Json => table::json(),
        Format::C => table::c_header(),
        Format::Python => table::python(),
    };
    session.output.raw(text.as_bytes())
}
