//! `servo set-id`: gives the only servo on the bus another id.

use std::io::{self, Write};
use std::time::Duration;

use clap::{Args, value_parser};
use serde::Serialize;
use sevenbot::servo_bench::scan::{AnswerQuality, FoundServo, ScanPlan};
use sevenbot::servo_bench::set_id::{SetIdError, set_id};

use super::port::{Rate, exchange_error, id, open};
use super::scan::with_progress;
use crate::advice::servo;
use crate::command_error::CommandError;
use crate::printer::Printable;
use crate::session::Session;

/// Give the only servo on the bus another id.
///
/// Asks all ids first. Writes nothing unless exactly one servo answers, with id OLD. Then unlocks the servo's EEPROM,
/// writes the id, locks the EEPROM, and checks that the servo answers to NEW only.
#[derive(Debug, Args)]
#[command(after_help = "\
Joint 1 has id 0, joint 7 has id 6.

Examples:
  sevenbot servo set-id 1 3  a new servo with id 1 becomes that of joint 4
  sevenbot servo set-id 1 3 --rate 500000")]
pub(super) struct SetIdArgs {
    /// The present id.
    #[arg(value_parser = id())]
    old: u8,
    /// The new id.
    #[arg(value_parser = id())]
    new: u8,
    #[command(flatten)]
    rate: Rate,
    /// Timeout for each id during the scan for other servos, in milliseconds.
    #[arg(long, value_name = "MS", value_parser = value_parser!(u16).range(1..))]
    wait: Option<u16>,
}

#[derive(Serialize)]
struct Changed {
    old_id: u8,
    id: u8,
}

impl Printable for Changed {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "the servo has id {} now; nothing answers to {} any more", self.id, self.old_id)
    }
}

pub(super) fn run(session: &mut Session, args: &SetIdArgs) -> Result<(), CommandError> {
    let &SetIdArgs { old, new, rate: Rate { rate }, wait } = args;
    if old == new {
        return Err(CommandError::Usage(format!("the old id and the new one are both {old}")));
    }
    let mut bus = open(session, rate)?;
    let plan = ScanPlan::all_ids(rate, wait.map(|millis| Duration::from_millis(millis.into())));
    match with_progress(&plan, |tell| set_id(&mut bus, &plan, old, new, tell)) {
        Ok(()) => session.printer.print(&Changed { old_id: old, id: new }),
        Err(SetIdError::Bus(error)) => Err(exchange_error(session, bus, error)),
        Err(error) => Err(CommandError::WithAdvice { message: error.to_string(), advice: advice(&error) }),
    }
}

fn advice(error: &SetIdError) -> &'static [&'static str] {
    match error {
        SetIdError::NotAlone { answering } => not_alone(answering),
        SetIdError::StaysLocked(_) | SetIdError::Unchanged => {
            &["switch the servo's power off and on, and try again: it still has its old id"]
        }
        SetIdError::Lost | SetIdError::IdUncertain(_) => &[
            "switch the servo's power off and on, then look with `sevenbot servo scan`",
            "the servo has either its old id or its new one; then try again",
        ],
        SetIdError::AnswersToBoth => &["unplug all servos but one, then look with `sevenbot servo scan`"],
        SetIdError::StaysOpen(_) => &["switch the servo's power off and on: that locks it"],
        SetIdError::Bus(error) => servo(error),
    }
}

const fn not_alone(answering: &[FoundServo]) -> &'static [&'static str] {
    match answering {
        [] => &["`sevenbot servo scan` tries all baud rates", "do the servos have their own power?"],
        [FoundServo { answers: AnswerQuality::Good, .. }] => &[
            "nothing was written: if the servo is to have that id, nothing is left to do",
            "otherwise name that id first: `sevenbot servo set-id ID NEW`",
        ],
        _ => &["unplug the other servos; nothing was written"],
    }
}
