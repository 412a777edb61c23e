//! `set`: writes registers in one frame, reads them back, and reports those that differ.

use clap::Args;
use sevenbot::checked_write::{MismatchCause, WriteMismatch};
use sevenbot::map::{BAUD_RATE, EEPROM_LOCK};
use sevenbot::map21::find_readable;
use sevenbot::names::{self, name_of_register};
use sevenbot::register_text::{self, entries};
use sevenbot::{Arm, Error, Span};

use super::get::{NAMES, RegisterList, not_served};
use crate::command_error::CommandError;
use crate::interrupt::hold_on_interrupt;
use crate::printer::note;
use crate::session::Session;
use crate::write_result::{all_taken, note_restart};

/// Write registers, read them back, and report those that differ.
#[derive(Debug, Args)]
#[command(after_help = format!("{NAMES}

Examples:
  sevenbot set speed 30                 all seven joints
  sevenbot set target-position.3 70
  sevenbot set feedback-frequency 30
  sevenbot set --unlock offset.2 -5     settings are locked, and kept without power
  sevenbot set --unlock options 2       the arm sends alarm frames of map 2.1
  sevenbot set wrist-position 4 100 4 200 4 150    a byte for each register: IK5 on the arm

Registers that only map 2.1 has are written by function 04. Reports of feedback-frequency go on, unless
other reports (82, 90) are switched on. Offsets then read as in map 2.2, as after any write of this program.

Exit status 1 when a register did not take its value."))]
pub(crate) struct SetArgs {
    /// Name, number or range of registers.
    #[arg(value_name = "REGISTER", value_parser = names::parse)]
    register: Span,
    /// One value per register, or one for all of them, in the units of the table.
    #[arg(required = true, value_name = "VALUE", allow_negative_numbers = true, value_parser = number)]
    pub(crate) values: Vec<i32>,
    /// The values are the bytes of the frame, 0 to 255 or 0x00 to 0xFF, and not checked.
    #[arg(long)]
    raw: bool,
    /// Open the EEPROM lock (register 28) before the write, and close it afterwards.
    #[arg(long)]
    unlock: bool,
}

/// Parses a decimal number, or a hexadecimal one after 0x.
fn number(text: &str) -> Result<i32, String> {
    let hexadecimal = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let parsed = match hexadecimal {
        Some(digits) => u8::from_str_radix(digits, 16).map(i32::from),
        None => text.parse(),
    };
    parsed.map_err(|_| "not a number".to_owned())
}

pub(crate) fn run(session: &mut Session, args: &SetArgs) -> Result<(), CommandError> {
    let span = args.register;
    let bytes = bytes(span, &args.values, args.raw)?;
    let mut arm = session.connect()?;
    if let Some(address) = span.addresses().find(|&address| !args.raw && !arm.serves(address)) {
        return Err(not_served(&arm, address));
    }
    // Targets, offsets and the motor state move the arm.
    let unchanged = hold_on_interrupt(&mut arm, |arm, _| {
        let write = |arm: &mut Arm| arm.write_checked(span.address(), &bytes);
        if args.unlock { unlocked(arm, write) } else { Ok(write(arm)?) }
    })?;
    session.printer.print(&RegisterList::from(entries(&arm.read_span(span)?)))?;
    note_causes(&arm, span, args, &unchanged);
    all_taken(&unchanged)
}

/// Runs `work` with the EEPROM lock open. Closes the lock afterwards, also after a failure.
pub(crate) fn unlocked<T>(
    arm: &mut Arm,
    work: impl FnOnce(&mut Arm) -> Result<T, Error>,
) -> Result<T, CommandError> {
    all_taken(&arm.write_checked(EEPROM_LOCK.address, &[0])?)?;
    let done = work(arm);
    let closed = arm.write_checked(EEPROM_LOCK.address, &[1]);
    let done = done?;
    all_taken(&closed?)?;
    Ok(done)
}

fn note_causes(arm: &Arm, span: Span, args: &SetArgs, unchanged: &[WriteMismatch]) {
    if unchanged.iter().any(|register| register.cause == MismatchCause::Locked) && !args.unlock {
        note("settings are protected by the EEPROM lock, register 28: --unlock opens it for this write");
    } else if unchanged.is_empty() {
        note_restart(arm, span.addresses());
    }
}

/// The bytes for a span: one value per register, or one for all.
fn bytes(span: Span, values: &[i32], raw: bool) -> Result<Vec<u8>, CommandError> {
    let registers = usize::from(span.count());
    let values = match values {
        [only] => vec![*only; registers],
        all if all.len() == registers => all.to_vec(),
        all => {
            let given = all.len();
            return Err(CommandError::Usage(format!(
                "{given} values for {registers} registers: one each, or one for all"
            )));
        }
    };
    let pairs = span.addresses().zip(values);
    pairs.map(|(address, value)| if raw { raw_byte(value) } else { byte(address, value) }).collect()
}

fn raw_byte(value: i32) -> Result<u8, CommandError> {
    u8::try_from(value).map_err(|_| CommandError::Usage(format!("{value} is not a byte, 0 to 255")))
}

/// The byte for a number in the table's unit. Refuses a number out of range, because the maker's firmware takes it.
fn byte(address: u8, value: i32) -> Result<u8, CommandError> {
    let Some(row) = find_readable(address) else { return raw_byte(value) };
    i16::try_from(value).ok().and_then(|value| row.range.encode_byte(value)).ok_or_else(|| {
        let (name, range) = (name_of_register(address), register_text::range(address));
        let hint = if *row == BAUD_RATE { "; `sevenbot baud` takes bits per second" } else { "" };
        CommandError::Arm(format!("{value} is out of range: {name} takes {range}; nothing was written{hint}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sevenbot::map::{OFFSET, TARGET_POSITION};

    #[test]
    fn numbers_are_decimal_or_hexadecimal() {
        assert_eq!(number("-5"), Ok(-5));
        assert_eq!(number("0x85"), Ok(0x85));
        assert!(number("0x100").is_err());
        assert!(number("five").is_err());
    }

    #[test]
    fn numbers_are_encoded_by_the_table() {
        let joint_2 = Span::one(OFFSET.address + 1);
        assert_eq!(bytes(joint_2, &[-5], false).ok(), Some(vec![0x85]));
        assert_eq!(bytes(Span::of(&OFFSET), &[3], false).ok(), Some(vec![3; 7]));
        let pose = [1, 2, 3, 4, 5, 6, 7];
        assert_eq!(bytes(Span::of(&TARGET_POSITION), &pose, false).ok(), Some((1..=7).collect()));
    }

    #[test]
    fn values_out_of_range_are_not_sent() {
        let target = Span::one(TARGET_POSITION.address);
        let Err(CommandError::Arm(said)) = bytes(target, &[181], false) else { panic!("out of range") };
        assert!(said.contains("target-position.1 takes 0 to 180"), "{said}");
        assert_eq!(bytes(target, &[181], true).ok(), Some(vec![181]), "--raw sends it");
        assert!(matches!(bytes(target, &[256], true), Err(CommandError::Usage(_))));
        assert!(matches!(bytes(target, &[1, 2], false), Err(CommandError::Usage(_))));
    }
}
