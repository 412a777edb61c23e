//! `set`: writes registers in one frame, reads them back, and reports those that differ. Motor state 1 is as in `state`.

use clap::Args;
use sevenbot::map::{BAUD_RATE, FINE_TARGET, MOTOR_STATE, SPEED, TARGET_POSITION, motor_state};
use sevenbot::names;
use sevenbot::register_text::entries;
use sevenbot::register_values::{self, ValueError};
use sevenbot::{Arm, Span};

use super::get::{NAMES, RegisterList, not_served};
use super::state::confirm_state;
use crate::command_error::CommandError;
use crate::interrupt::hold_on_interrupt;
use crate::printer::note;
use crate::register_parser::RegisterParser;
use crate::session::{Session, put_right};
use crate::write_result::note_restart;

/// Write registers, read them back, and report those that differ.
#[derive(Debug, Args)]
#[command(after_help = format!("{NAMES}

Examples:
  sevenbot set speed 30              all seven joints
  sevenbot set target-position.3 70
  sevenbot set feedback-frequency 30
  sevenbot set fine-target.3 7025    70.25 degrees: its unit is 0.01 degrees
  sevenbot set --unlock offset.2 -5  settings are locked, and kept without power
  sevenbot set --unlock options 2    the arm sends alarm frames of map 2.1
  sevenbot set wrist-position 4 100 4 200 4 150
                                     a byte for each register: IK5 on the arm

A register of two bytes takes one number. With --raw each byte is given, the low
one first. Registers that only map 2.1 has are written by function 04. Reports
of feedback-frequency go on, unless other reports (82, 90) are switched on.
Offsets then read as in map 2.2, as after any write of this program.

A target of a joint that is driven is a move, as with `sevenbot pose`: it is not
written while the joint does not answer or has let go. --raw writes it all the
same. `motor-state 1` is as `sevenbot state servo`. A motor state without torque
asks first: the arm may fall.

Exit status 1 when a register did not take its value, a setting is not stored,
or the joints do not obey; 2 when the table does not allow the value."))]
pub(crate) struct SetArgs {
    /// Name, number or range of registers.
    #[arg(value_name = "REGISTER", value_parser = RegisterParser(names::parse), hide_possible_values = true)]
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
    /// Do not ask whether the arm is held.
    #[arg(long)]
    yes: bool,
}

/// Parses a decimal number, or a hexadecimal one after 0x.
fn number(text: &str) -> Result<i32, String> {
    let hexadecimal = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let parsed = match hexadecimal {
        Some(digits) => u8::from_str_radix(digits, 16).map(i32::from),
        None => text.parse(),
    };
    parsed.map_err(|_| {
        "registers take whole numbers, or 0x00 to 0xFF; docs/registers.md has their units".to_owned()
    })
}

pub(crate) fn run(session: &mut Session, args: &SetArgs) -> Result<(), CommandError> {
    let span = args.register;
    let bytes = bytes(span, &args.values, args.raw)?;
    let mut arm = session.connect()?;
    if let Some(address) = span.addresses().find(|&address| !args.raw && !arm.serves(address)) {
        return Err(not_served(&arm, address));
    }
    confirm_release(&mut arm, span, &bytes, args.yes)?;
    // Targets, offsets and the motor state move the arm, so Ctrl-C has to make it hold.
    let written = hold_on_interrupt(&mut arm, |arm, _| {
        let moves = |address| [TARGET_POSITION, FINE_TARGET, SPEED].iter().any(|row| row.holds(address));
        if span.addresses().any(moves) {
            put_right(arm)?;
        }
        if !args.raw || span == Span::of(&MOTOR_STATE) {
            return Ok(arm.set_registers(span.address(), &bytes, args.unlock)?);
        }
        let write = |arm: &mut Arm| arm.write_checked(span.address(), &bytes);
        Ok(if args.unlock { arm.with_open_lock(write) } else { write(arm) }?)
    });
    if matches!(written, Ok(()) | Err(CommandError::NotTaken(_))) {
        session.printer.print(&RegisterList::from(entries(&arm.read_span(span)?)))?;
    }
    match &written {
        Ok(()) => note_restart(&arm, span.addresses()),
        Err(CommandError::NotTaken(not_taken)) if not_taken.is_locked() && !args.unlock => {
            note("settings are protected by the EEPROM lock, register 28: --unlock opens it for this write");
        }
        Err(_) => {}
    }
    written
}

/// Asks for confirmation, as `state` does, if this write would take the torque of a driven arm away.
fn confirm_release(arm: &mut Arm, span: Span, bytes: &[u8], yes: bool) -> Result<(), CommandError> {
    let wanted = span.addresses().zip(bytes).find(|(address, _)| MOTOR_STATE.holds(*address));
    match wanted {
        Some((_, &state)) if state <= motor_state::FORCELESS => confirm_state(arm, state, yes),
        _ => Ok(()),
    }
}

/// The bytes for a span: one value per register, or one for all. A register of two bytes takes one value. With `raw`, each
/// value is a byte.
fn bytes(span: Span, values: &[i32], raw: bool) -> Result<Vec<u8>, CommandError> {
    let encoded =
        if raw { register_values::raw_bytes(span, values) } else { register_values::bytes(span, values) };
    encoded.map_err(|error| match error {
        ValueError::OutOfRange { address, .. } => {
            let hint = if BAUD_RATE.holds(address) { "; `sevenbot baud` takes bits per second" } else { "" };
            CommandError::Usage(format!("{error}; nothing was written{hint}"))
        }
        other => CommandError::Usage(other.to_string()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sevenbot::map::{FINE_TARGET, OFFSET, SET_POINT_PERIOD, TARGET_POSITION};

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
        let Err(CommandError::Usage(said)) = bytes(target, &[181], false) else { panic!("out of range") };
        assert!(said.contains("target-position.1 takes 0 to 180"), "{said}");
        assert_eq!(bytes(target, &[181], true).ok(), Some(vec![181]), "--raw sends it");
        assert!(matches!(bytes(target, &[256], true), Err(CommandError::Usage(_))));
        assert!(matches!(bytes(target, &[1, 2], false), Err(CommandError::Usage(_))));
    }

    #[test]
    fn d22_a_register_of_two_bytes_takes_one_number() {
        assert_eq!(bytes(Span::of(&FINE_TARGET), &[9_025], false).ok(), Some([0x41, 0x23].repeat(7)));
        let period = Span::of(&SET_POINT_PERIOD);
        assert_eq!(bytes(period, &[300], false).ok(), Some(vec![0x2C, 1]));
        assert_eq!(bytes(period, &[0x2C, 1], true).ok(), Some(vec![0x2C, 1]), "--raw takes bytes");
        assert_eq!(bytes(Span::new(184, 3).expect("a span"), &[20, 30], false).ok(), Some(vec![20, 0, 30]));
        let Err(CommandError::Usage(said)) = bytes(period, &[4], false) else { panic!("out of range") };
        assert!(said.contains("set-point-period takes 0, or 5 to 1000"), "{said}");
        for (address, count) in [(184, 1), (185, 1), (129, 3), (128, 3)] {
            let half = bytes(Span::new(address, count).expect("a span"), &[5], false);
            assert!(
                matches!(half, Err(CommandError::Usage(said)) if said.contains("has two bytes")),
                "{address}"
            );
        }
    }
}
