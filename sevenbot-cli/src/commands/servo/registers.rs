//! `servo get`, `set`, `dump`: the servos' own registers, by name.

use std::io::{self, Write};

use clap::{Args, ValueEnum};
use serde::Serialize;
use sevenbot::servo_bench::BusMaster;
use sevenbot::servo_bench::register_access::{ServoValue, SetError, get, get_all, set};
use sevenbot::servo_bench::register_table::{SERVO_REGISTERS, ServoRegister};

use super::port::{Rate, exchange_error, id, open};
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::printer::Printable;
use crate::session::Session;
use crate::style::BOLD;

/// Show registers of one servo, by name.
///
/// Only reads: the servo does not move.
#[derive(Debug, Args)]
#[command(after_help = "\
`sevenbot servo dump ID` shows all names.

Examples:
  sevenbot servo get 1 max-torque unload-conditions
  sevenbot servo get 1 present-temperature --json")]
pub(super) struct GetRegistersArgs {
    /// The servo's id.
    #[arg(value_parser = id())]
    id: u8,
    /// Names of registers.
    #[arg(required = true, value_parser = register)]
    names: Vec<&'static ServoRegister>,
    #[command(flatten)]
    rate: Rate,
}

/// Write a register of one servo, by name, and read it back.
///
/// A setting in the servo's EEPROM is kept without power. The EEPROM is opened for it, and locked again.
#[derive(Debug, Args)]
#[command(after_help = "\
A value out of range, and a register that cannot be written, are refused before
anything is sent. `sevenbot servo set-id` gives a servo another id. After a new
baud rate the servo answers at that rate only: use --rate from then on.

Asks before a write that may turn the motor: torque switch, goals,
position limits.

Examples:
  sevenbot servo set 1 max-torque 800
  sevenbot servo set 1 unload-conditions 37
        voltage, heat and overload switch its torque off
  sevenbot servo set 1 goal-position 511 --yes")]
pub(super) struct SetRegisterArgs {
    /// The servo's id.
    #[arg(value_parser = id())]
    id: u8,
    /// The name of a register.
    #[arg(value_parser = register)]
    name: &'static ServoRegister,
    /// The value, in the unit that `sevenbot servo dump` shows.
    #[arg(allow_negative_numbers = true)]
    value: i32,
    #[command(flatten)]
    rate: Rate,
    /// Do not ask before a write that may turn the motor.
    #[arg(long)]
    yes: bool,
}

/// Show all registers of one servo: address, name, value, unit, memory, range, source.
///
/// Only reads: the servo does not move.
#[derive(Debug, Args)]
#[command(after_help = "\
Registers whose source is \"SCS memory table\" may be missing in servos with
older firmware, and then read 0.

Examples:
  sevenbot servo dump 1
  sevenbot servo dump 1 --format toml > servo-1.toml
  sevenbot servo dump 1 --json")]
pub(super) struct DumpArgs {
    /// The servo's id.
    #[arg(value_parser = id())]
    id: u8,
    /// A table for people, or TOML; --json prints JSON.
    #[arg(long, value_enum, default_value_t = DumpFormat::Table)]
    format: DumpFormat,
    #[command(flatten)]
    rate: Rate,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum DumpFormat {
    /// A line for each register.
    Table,
    /// `name = value` for each register that can be written and is kept.
    Toml,
}

fn register(name: &str) -> Result<&'static ServoRegister, String> {
    ServoRegister::find(name).ok_or_else(|| {
        let names: Vec<_> = SERVO_REGISTERS.iter().map(|row| row.name).collect();
        format!("the names are {}", names.join(", "))
    })
}

/// Values of registers of one servo.
#[derive(Serialize)]
struct ServoValues {
    id: u8,
    registers: Vec<ValueRow>,
    #[serde(skip)]
    is_long: bool,
}

#[derive(Serialize)]
struct ValueRow {
    address: u8,
    bytes: u8,
    name: &'static str,
    value: i32,
    meaning: String,
    unit: &'static str,
    memory: &'static str,
    lowest: u16,
    highest: u16,
    source: &'static str,
}

impl From<ServoValue> for ValueRow {
    fn from(ServoValue { register, value }: ServoValue) -> Self {
        Self {
            address: register.address,
            bytes: register.width,
            name: register.name,
            value,
            meaning: register.meaning(value),
            unit: register.unit,
            memory: register.memory.name(),
            lowest: register.range.0,
            highest: register.range.1,
            source: register.source.name(),
        }
    }
}

impl Printable for ServoValues {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.is_long {
            writeln!(
                out,
                "{BOLD}addr  name                 value  meaning                        memory     range       source{BOLD:#}"
            )?;
        }
        for row in &self.registers {
            let ValueRow { address, name, value, meaning, memory, lowest, highest, source, .. } = row;
            let start = format!("{address:>4}  {name:<19} {value:>6}  {meaning}");
            if self.is_long {
                let range = format!("{lowest}..{highest}");
                writeln!(out, "{start:<64} {memory:<10} {range:<11} {source}")?;
            } else {
                writeln!(out, "{}", start.trim_end())?;
            }
        }
        Ok(())
    }
}

pub(super) fn run_get(session: &mut Session, args: &GetRegistersArgs) -> Result<(), CommandError> {
    let read = |bus: &mut BusMaster| args.names.iter().map(|row| get(bus, args.id, row)).collect();
    let values: Vec<ServoValue> = with_bus(session, args.rate, read)?;
    print(session, args.id, values, false)
}

pub(super) fn run_dump(session: &mut Session, args: &DumpArgs) -> Result<(), CommandError> {
    let values = with_bus(session, args.rate, |bus| get_all(bus, args.id))?;
    match args.format {
        DumpFormat::Toml if !session.printer.is_json() => {
            session.printer.print_raw(toml(args.id, &values).as_bytes())
        }
        _ => print(session, args.id, values, true),
    }
}

pub(super) fn run_set(session: &mut Session, args: &SetRegisterArgs) -> Result<(), CommandError> {
    let SetRegisterArgs { id, name: row, value, rate, yes } = args;
    let mut bus = open(session, rate.rate)?;
    if row.may_move {
        confirm(&format!("This may turn servo {id}. Is its way free, and the arm supported?"), *yes)?;
    }
    match set(&mut bus, *id, row, *value) {
        Ok(written) => print(session, *id, vec![written], false),
        Err(SetError::Bus(error)) => Err(exchange_error(session, bus, error)),
        Err(error @ (SetError::ReadOnly(_) | SetError::OutOfRange { .. } | SetError::IdNeedsCheck)) => {
            Err(CommandError::Usage(format!("{error}; nothing was written")))
        }
        Err(error) => Err(CommandError::WithAdvice {
            message: error.to_string(),
            advice: &[
                "switch the servo's power off and on: that locks it",
                "then look with `sevenbot servo dump`",
            ],
        }),
    }
}

fn with_bus<T>(
    session: &Session,
    rate: Rate,
    work: impl FnOnce(&mut BusMaster) -> Result<T, sevenbot::servo_bench::ServoError>,
) -> Result<T, CommandError> {
    let mut bus = open(session, rate.rate)?;
    work(&mut bus).map_err(|error| exchange_error(session, bus, error))
}

fn print(session: &mut Session, id: u8, values: Vec<ServoValue>, is_long: bool) -> Result<(), CommandError> {
    let registers = values.into_iter().map(ValueRow::from).collect();
    session.printer.print(&ServoValues { id, registers, is_long })
}

/// The EEPROM registers as TOML.
fn toml(id: u8, values: &[ServoValue]) -> String {
    use sevenbot::servo_bench::register_table::ServoMemory;

    let settings = values.iter().filter(|value| value.register.memory == ServoMemory::Eeprom);
    let lines = settings.map(|ServoValue { register, value }| {
        let meaning = register.meaning(*value);
        let comment = if meaning.is_empty() { String::new() } else { format!("  # {meaning}") };
        format!("{} = {value}{comment}\n", register.name)
    });
    format!("# the settings of servo {id}\n{}", lines.collect::<String>())
}
