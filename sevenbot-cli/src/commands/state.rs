//! `state`: whether the motors drive the joints, and a warning before an arm falls.

use clap::{Args, ValueEnum};
use sevenbot::map::{MOTOR_STATE, motor_state};
use sevenbot::register_text::entries;
use sevenbot::{Arm, Span};

use super::get::RegisterList;
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::interrupt::hold_on_interrupt;
use crate::session::Session;
use crate::write_result::motors_obey;

/// Show or change the state of the motors.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot state                     what it is
  sevenbot state servo               the arm holds where it is found, and can be moved
  sevenbot state forceless --yes     the arm can be moved by hand; without a hand it falls

Exit status 1 when it is not known that the arm took the state: it may be moving then.")]
pub(crate) struct StateArgs {
    /// The state wanted.
    state: Option<MotorStateArg>,
    /// The arm is held, or may fall: do not ask.
    #[arg(long)]
    yes: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum MotorStateArg {
    /// The joints are driven.
    Servo,
    /// The joints are not driven, but braked.
    Damping,
    /// The joints move freely.
    Forceless,
}

impl MotorStateArg {
    const fn code(self) -> u8 {
        match self {
            Self::Servo => motor_state::SERVO,
            Self::Damping => motor_state::DAMPING,
            Self::Forceless => motor_state::FORCELESS,
        }
    }
}

pub(crate) fn run(session: &mut Session, args: &StateArgs) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    if let Some(wanted) = args.state {
        change(&mut arm, wanted, args.yes)?;
    }
    session.printer.print(&RegisterList::from(entries(&arm.read_span(Span::of(&MOTOR_STATE))?)))
}

fn change(arm: &mut Arm, wanted: MotorStateArg, yes: bool) -> Result<(), CommandError> {
    let present = arm.read_span(Span::of(&MOTOR_STATE))?.byte(&MOTOR_STATE);
    if present == motor_state::SERVO && wanted.code() != motor_state::SERVO {
        let how = if matches!(wanted, MotorStateArg::Damping) { "sink" } else { "fall" };
        confirm(&format!("The arm will {how} unless somebody holds it. Go on?"), yes)?;
    }
    hold_on_interrupt(arm, |arm, _| motors_obey(arm.write_checked(MOTOR_STATE.address, &[wanted.code()])))
}
