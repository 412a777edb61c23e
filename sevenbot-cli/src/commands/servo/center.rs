//! `servo center`: moves a servo to the middle of its range.

use std::io::{self, Write};

use clap::{Args, value_parser};
use serde::Serialize;
use sevenbot::servo_bench::center::{CenterError, CenterOptions, MIDDLE, center};
use sevenbot::servo_bench::{BusMaster, Reading};

use super::port::{Rate, exchange_error, id, open};
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::interrupt::Interrupt;
use crate::printer::{Printable, note};
use crate::progress::Progress;
use crate::session::Session;

/// Move a servo slowly to the middle of its range, 511 counts.
///
/// The goal becomes the present position, the torque goes on, then the goal becomes the middle. The torque goes off if
/// the load exceeds --load, if the servo makes no progress for 3 s, and at Ctrl-C. At the end the servo holds the
/// middle with torque on, so that a horn or a gear can be fitted.
#[derive(Debug, Args)]
#[command(after_help = "\
Best with a single servo on the bench. In an arm, support the arm: a stopped
servo has no torque.

Examples:
  sevenbot servo center 3
  sevenbot servo center 3 --speed 50 --load 30 --yes")]
pub(super) struct CenterArgs {
    /// The servo's id.
    #[arg(value_parser = id())]
    id: u8,
    #[command(flatten)]
    rate: Rate,
    /// Speed in counts per second; 100 are about 21 degrees/s in joints 1 to 4, 29 in 5 to 7.
    #[arg(long, value_name = "COUNTS", default_value_t = 100, value_parser = value_parser!(u16).range(1..=1000))]
    speed: u16,
    /// The load that ends the move, in percent of the stall torque.
    #[arg(long, value_name = "PERCENT", default_value_t = 60, value_parser = value_parser!(u16).range(1..=100))]
    load: u16,
    /// Move without a question.
    #[arg(long)]
    yes: bool,
}

#[derive(Serialize)]
struct Centered {
    id: u8,
    position_counts: u16,
}

impl Printable for Centered {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "servo {} holds at {} counts", self.id, self.position_counts)
    }
}

pub(super) fn run(session: &mut Session, args: &CenterArgs) -> Result<(), CommandError> {
    let id = args.id;
    let mut bus = open(session, args.rate.rate)?;
    // Check that the servo answers before asking the user.
    if let Err(error) = bus.read(id, 0, 1) {
        return Err(exchange_error(session, bus, error));
    }
    confirm(
        &format!("Servo {id} moves to {MIDDLE} counts. Is its way free, and the arm supported?"),
        args.yes,
    )?;
    match drive(&mut bus, args) {
        Ok(position_counts) => session.printer.print(&Centered { id, position_counts }),
        Err(CenterError::Interrupted) => {
            note("the servo stopped, and its torque is off");
            Err(CommandError::Interrupted)
        }
        Err(CenterError::Bus(error)) => Err(exchange_error(session, bus, error)),
        Err(error) => Err(CommandError::WithAdvice { message: error.to_string(), advice: advice(&error) }),
    }
}

fn drive(bus: &mut BusMaster, args: &CenterArgs) -> Result<u16, CenterError> {
    let limits = CenterOptions { speed: args.speed, load: args.load * 10, ..CenterOptions::default() };
    Interrupt::catch();
    let mut progress: Option<(Progress, u16)> = None;
    center(bus, args.id, &limits, |reading| {
        let distance = |reading: &Reading| reading.position_counts.abs_diff(MIDDLE);
        let (bar, total) = progress
            .get_or_insert_with(|| (Progress::new(distance(reading).into(), "counts"), distance(reading)));
        bar.set(total.saturating_sub(distance(reading)).into());
        bar.say(&format!("load {:.1} %", f64::from(reading.load) / 10.0));
        !Interrupt::is_requested()
    })
}

const fn advice(error: &CenterError) -> &'static [&'static str] {
    match error {
        CenterError::OutOfReach { .. } | CenterError::Unmeasured => {
            &["nothing was moved; see `sevenbot servo info`"]
        }
        CenterError::ReportsErrors { .. } => {
            &["nothing was moved; an overload ends when the servo's power goes off and on"]
        }
        CenterError::Overload { .. } | CenterError::Stalled { .. } => &[
            "the servo's torque is off",
            "is something in its way, or its horn at a stop? Is its supply strong enough?",
        ],
        CenterError::TorqueStillOn(_) => &["switch the servos' supply off"],
        CenterError::Bus(_) | CenterError::Interrupted => &[],
    }
}
