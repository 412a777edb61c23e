//! `servo torque-codes`: finds which of two published tables describes register 40 of a servo.
//!
//! The user turns the joint by hand with codes 0 and 2. Code 1, torque on, is never written.

use std::io::{self, IsTerminal, Write};

use clap::Args;
use serde::Serialize;
use sevenbot::servo_bench::register::TORQUE_SWITCH;
use sevenbot::servo_bench::{BusMaster, ServoError, TorqueCodes};

use super::port::{Rate, exchange_error, id, open};
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::printer::Printable;
use crate::session::Session;

/// Find out by hand what codes 0 and 2 of the torque switch (register 40) mean.
///
/// There are two tables. In the older one 0 is damping and 2 is free; in Feetech's current one 0 is free and 2 is
/// damping. Code 1 is torque on in both. It is not written, so the motor never drives the servo. Turn joint 1, which
/// carries no weight, and enter the code with which it turns more easily.
#[derive(Debug, Args)]
#[command(after_help = "\
With a hand on the joint:
  Enter      switch to the other code
  0, 2       it turns lighter with this code: that ends the test
  s          both feel the same
  q          end, without a result

Afterwards the servo has no torque, with code 0.

Examples:
  sevenbot servo torque-codes
  sevenbot servo torque-codes --id 4 --json    another servo, alone on the bench")]
pub(super) struct TorqueCodesArgs {
    /// The servo's id; 0 is joint 1.
    #[arg(long, default_value_t = 0, value_parser = id())]
    id: u8,
    #[command(flatten)]
    rate: Rate,
}

#[derive(Serialize)]
struct TorqueCodeResult {
    id: u8,
    lighter_code: u8,
    /// The value for `host-sim --torque-codes`.
    table: &'static str,
    /// The constant for the firmware.
    torque_codes: &'static str,
}

impl TorqueCodeResult {
    const fn new(id: u8, lighter: TorqueOffCode) -> Self {
        let (table, torque_codes) = match lighter.table() {
            TorqueCodes::DampingOnFree => ("older", "DampingOnFree"),
            TorqueCodes::FreeOnDamping => ("current", "FreeOnDamping"),
        };
        Self { id, lighter_code: lighter.number(), table, torque_codes }
    }
}

impl Printable for TorqueCodeResult {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let &Self { lighter_code, table, torque_codes, .. } = self;
        writeln!(out, "{table} table: code {lighter_code} is free, code {} is damping", 2 - lighter_code)?;
        let default = if table == "older" { ", which is its default" } else { "" };
        writeln!(out, "board:    TORQUE_CODES in board.rs is TorqueCodes::{torque_codes}{default}")?;
        writeln!(out, "computer: host-sim --torque-codes {table}{default}")
    }
}

/// The two codes without torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TorqueOffCode {
    Zero,
    Two,
}

impl TorqueOffCode {
    const fn number(self) -> u8 {
        match self {
            Self::Zero => 0,
            Self::Two => 2,
        }
    }

    const fn other(self) -> Self {
        match self {
            Self::Zero => Self::Two,
            Self::Two => Self::Zero,
        }
    }

    /// The table in which this code is free.
    const fn table(self) -> TorqueCodes {
        match self {
            Self::Zero => TorqueCodes::FreeOnDamping,
            Self::Two => TorqueCodes::DampingOnFree,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TorqueCodeInput {
    Switch,
    Lighter(TorqueOffCode),
    Same,
    Quit,
}

impl TorqueCodeInput {
    fn parse(line: &str) -> Option<Self> {
        Some(match line.trim() {
            "" => Self::Switch,
            "0" => Self::Lighter(TorqueOffCode::Zero),
            "2" => Self::Lighter(TorqueOffCode::Two),
            "s" | "S" => Self::Same,
            "q" | "Q" => Self::Quit,
            _ => return None,
        })
    }
}

pub(super) fn run(session: &mut Session, args: &TorqueCodesArgs) -> Result<(), CommandError> {
    if !io::stdin().is_terminal() {
        let why = "torque-codes needs your answers: run it in a terminal";
        return Err(CommandError::Usage(why.to_owned()));
    }
    let id = args.id;
    let mut bus = open(session, args.rate.rate)?;
    if let Err(error) = bus.read(id, TORQUE_SWITCH, 1) {
        return Err(exchange_error(session, bus, error));
    }
    confirm(
        &format!("The torque of servo {id} goes off. Is the arm supported, and your hand on the joint?"),
        false,
    )?;
    let lighter = ask_lighter_code(&mut bus, id);
    // Switch torque off also after a failure. Of two failures the first is reported.
    let ended = switch(&mut bus, id, TorqueOffCode::Zero);
    match lighter? {
        Err(error) => Err(exchange_error(session, bus, error)),
        Ok(lighter) => match ended {
            Err(error) => Err(exchange_error(session, bus, error)),
            Ok(()) => session.printer.print(&TorqueCodeResult::new(id, lighter)),
        },
    }
}

/// Asks for the code with which the joint turns more easily. The outer error is of the input, the inner one of the bus.
fn ask_lighter_code(bus: &mut BusMaster, id: u8) -> Result<Result<TorqueOffCode, ServoError>, CommandError> {
    let (mut code, mut has_tried_both) = (TorqueOffCode::Zero, false);
    if let Err(error) = switch(bus, id, code) {
        return Ok(Err(error));
    }
    loop {
        match ask(code)? {
            Some(TorqueCodeInput::Switch) => {
                code = code.other();
                has_tried_both = true;
                if let Err(error) = switch(bus, id, code) {
                    return Ok(Err(error));
                }
            }
            Some(TorqueCodeInput::Quit) => {
                return Err(CommandError::Arm("ended without a result".to_owned()));
            }
            Some(_) if !has_tried_both => say("try the other code first: press Enter")?,
            Some(TorqueCodeInput::Lighter(code)) => return Ok(Ok(code)),
            Some(TorqueCodeInput::Same) => return Err(no_difference()),
            None => say("type Enter, 0, 2, s or q")?,
        }
    }
}

fn no_difference() -> CommandError {
    CommandError::WithAdvice {
        message: "both codes feel the same: the table remains unknown".to_owned(),
        advice: &[
            "turn the joint faster: damping grows with speed",
            "compare with the servos' power off, which feels like free",
            "keep the default, the older table: with the wrong one an arm drops where it should sink",
        ],
    }
}

fn switch(bus: &mut BusMaster, id: u8, code: TorqueOffCode) -> Result<(), ServoError> {
    bus.write(id, TORQUE_SWITCH, &[code.number()])
}

fn say(message: &str) -> io::Result<()> {
    writeln!(anstream::stderr(), "{message}")
}

fn ask(code: TorqueOffCode) -> Result<Option<TorqueCodeInput>, CommandError> {
    let mut err = anstream::stderr();
    write!(
        err,
        "code {} is active: turn the joint. Enter: other code, 0 or 2: lighter code, s: same, q: quit > ",
        code.number()
    )?;
    err.flush()?;
    let mut line = String::new();
    if io::stdin().read_line(&mut line)? == 0 {
        return Ok(Some(TorqueCodeInput::Quit));
    }
    Ok(TorqueCodeInput::parse(&line))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lighter_code_selects_the_table() {
        let result = |code| {
            let result = TorqueCodeResult::new(0, code);
            (result.lighter_code, result.table, result.torque_codes)
        };
        assert_eq!(result(TorqueOffCode::Two), (2, "older", "DampingOnFree"));
        assert_eq!(result(TorqueOffCode::Zero), (0, "current", "FreeOnDamping"));
    }

    #[test]
    fn the_table_agrees_with_the_controller() {
        use sevenbot::servo_bench::Torque;
        for code in [TorqueOffCode::Zero, TorqueOffCode::Two] {
            assert_eq!(code.table().code(Torque::Free), code.number());
            assert_eq!(code.table().code(Torque::Damping), code.other().number());
        }
    }

    #[test]
    fn input_is_a_code_or_a_letter() {
        assert_eq!(TorqueCodeInput::parse("\n"), Some(TorqueCodeInput::Switch));
        assert_eq!(TorqueCodeInput::parse("2\n"), Some(TorqueCodeInput::Lighter(TorqueOffCode::Two)));
        assert_eq!(TorqueCodeInput::parse("1\n"), None);
    }
}
