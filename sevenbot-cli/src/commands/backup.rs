//! `backup`, `restore`: copy the settings of an arm to a file, and back.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use sevenbot::map::BAUD_RATE;
use sevenbot::map21::{OPTIONS, find_readable};
use sevenbot::names::{name_of, name_of_register};
use sevenbot::register_text::meaning;
use sevenbot::{Arm, Register, Snapshot};

use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::interrupt::hold_on_interrupt;
use crate::output_file::{ForceArg, OutputFile};
use crate::printer::{Printable, note, warn};
use crate::session::Session;
use crate::settings_file::{SettingsFile, span};
use crate::write_result::note_restart;

/// Write the settings of the arm to a file.
#[derive(Debug, Args)]
#[command(after_help = "\
Settings keep their value without power: device id, baud rate, offsets, options
(register 20; an arm with the maker's firmware has none). The file is TOML; on
standard output with --json it is JSON.

Examples:
  sevenbot backup arm-42.toml
  sevenbot backup -                      to standard output")]
pub(crate) struct BackupArgs {
    /// The file; - is standard output.
    file: PathBuf,
    #[command(flatten)]
    force: ForceArg,
}

/// Write settings from a file to the arm, and verify them.
#[derive(Debug, Args)]
#[command(after_help = "\
Shows the changes and asks first. A file from another arm, by its chip id, is
refused without --other-arm: offsets belong to one arm. Settings missing in the
file keep their value. Settings that the arm's firmware lacks are not written,
with a warning. Reports of feedback-frequency go on.

Examples:
  sevenbot restore arm-42.toml
  sevenbot restore --yes arm-42.toml     for scripts")]
pub(crate) struct RestoreArgs {
    /// The file.
    file: PathBuf,
    /// Do not ask.
    #[arg(long)]
    yes: bool,
    /// Write the settings although the file is from another arm.
    #[arg(long)]
    other_arm: bool,
}

pub(crate) fn backup(session: &mut Session, args: &BackupArgs) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    let registers = arm.read_span(span())?;
    let file = SettingsFile::of(&arm, &registers);
    let text = file.text()?;
    if args.file.as_os_str() == "-" {
        return session.printer.print(&file);
    }
    OutputFile::open(&args.file, None, args.force)?.write(text.as_bytes())?;
    note(format_args!("settings written to {}", args.file.display()));
    Ok(())
}

pub(crate) fn restore(session: &mut Session, args: &RestoreArgs) -> Result<(), CommandError> {
    let file = SettingsFile::read(&args.file)?;
    let mut arm = session.connect()?;
    let now = arm.read_span(span())?;
    let (wanted, missing) = file.applied_to(&args.file, &now, |address| arm.serves(address))?;
    warn_of_missing(&arm, &missing);
    let changes = changes(&now, &wanted);
    session.printer.print(&Changes { changes: &changes })?;
    if changes.is_empty() {
        return Ok(());
    }
    check_chip(&arm, &file, args.other_arm)?;
    confirm("Write these settings?", args.yes)?;
    write(&mut arm, &changed_registers(&changes, &wanted))?;
    note("written and verified");
    note_restart(&arm, changes.iter().map(|change| change.address));
    Ok(())
}

/// Fails if the file is from another arm, unless `may_differ`: offsets belong to one arm.
fn check_chip(arm: &Arm, file: &SettingsFile, may_differ: bool) -> Result<(), CommandError> {
    let chip = arm.identity().chip_name();
    if file.chip_id == chip || may_differ {
        return Ok(());
    }
    Err(CommandError::Usage(format!(
        "the file is from the arm with chip {}, but this arm has chip {chip}, and offsets belong to one arm: \
         --other-arm writes them; nothing was written",
        file.chip_id
    )))
}

fn warn_of_missing(arm: &Arm, settings: &[&Register]) {
    let version = arm.identity().version();
    for row in settings {
        warn(format_args!(
            "the arm's firmware {version} has no {}: this setting is not written",
            name_of(row)
        ));
    }
}

/// The registers from the first change to the last.
fn changed_registers(changes: &[Change], wanted: &Snapshot) -> Snapshot {
    let (Some(first), Some(last)) = (changes.first(), changes.last()) else { return wanted.clone() };
    let values = (first.address..=last.address).map(|address| wanted.at(address)).collect();
    Snapshot { address: first.address, values }
}

/// Writes all changes in one frame: after a power cut this project's firmware has all of them or none (D19).
fn write(arm: &mut Arm, wanted: &Snapshot) -> Result<(), CommandError> {
    // New offsets may move the arm a little, so Ctrl-C has to make it hold.
    let write = |arm: &mut Arm| arm.write_checked(wanted.address, &wanted.values);
    hold_on_interrupt(arm, |arm, _| Ok(arm.with_open_lock(write)?))
}

#[derive(Debug, Serialize)]
struct Change {
    address: u8,
    register: String,
    from: String,
    to: String,
}

#[derive(Serialize)]
struct Changes<'a> {
    changes: &'a [Change],
}

impl Printable for Changes<'_> {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.changes.is_empty() {
            return writeln!(out, "the arm has these settings already");
        }
        for Change { register, from, to, .. } in self.changes {
            writeln!(out, "{register:<12}  {from:>12}  ->  {to}")?;
        }
        Ok(())
    }
}

fn changes(now: &Snapshot, wanted: &Snapshot) -> Vec<Change> {
    let pairs = now.span().addresses().zip(now.values.iter().zip(&wanted.values));
    let changed = pairs.filter(|(_, (from, to))| from != to);
    let change = |(address, (from, to)): (u8, (&u8, &u8))| Change {
        address,
        register: name_of_register(address),
        from: in_words(address, *from),
        to: in_words(address, *to),
    };
    changed.map(change).collect()
}

fn in_words(address: u8, byte: u8) -> String {
    match find_readable(address) {
        Some(row) if [BAUD_RATE, OPTIONS].contains(row) => meaning(row, byte),
        Some(row) => format!("{} {}", row.range.decode_byte(byte), row.unit.symbol()).trim_end().to_owned(),
        None => byte.to_string(),
    }
}
