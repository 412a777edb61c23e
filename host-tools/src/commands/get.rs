//! `get`: registers as a list of address, name, value and meaning.

use std::io::{self, Write};

use sevenbot::Arm;
use sevenbot::words::{Entry, entries, raw_entries};

use crate::cli::GetArgs;
use crate::failure::Failure;

pub(crate) fn run(arm: &mut Arm, args: &GetArgs, out: &mut impl Write) -> Result<(), Failure> {
    for &span in &args.registers {
        let snapshot = arm.read_span(span)?;
        show(&if args.raw { raw_entries(&snapshot) } else { entries(&snapshot) }, out)?;
    }
    Ok(())
}

/// One line an entry, in columns.
pub(crate) fn show(entries: &[Entry], out: &mut impl Write) -> io::Result<()> {
    for Entry { address, name, value, meaning } in entries {
        let line = format!("{address:>3}  {name:<24} {value:>5}  {meaning}");
        writeln!(out, "{}", line.trim_end())?;
    }
    Ok(())
}
