//! `state`: whether the motors drive the joints, and a warning before an arm falls.

use clap::{Args, ValueEnum};
use sevenbot::map::{MOTOR_STATE, motor_state};
use sevenbot::words::entries;
use sevenbot::{Arm, Span};

use super::get::Registers;
use super::motors_obey;
use crate::confirm::confirm;
use crate::failure::Failure;
use crate::interrupt::or_hold;
use crate::session::Session;

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
    state: Option<Wanted>,
    /// The arm is held, or may fall: do not ask.
    #[arg(long)]
    yes: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Wanted {
    /// The joints are driven.
    Servo,
    /// The joints are not driven, but braked.
    Damping,
    /// The joints move freely.
    Forceless,
}

impl Wanted {
    const fn code(self) -> u8 {
        match self {
            Self::Servo => motor_state::SERVO,
            Self::Damping => motor_state::DAMPING,
            Self::Forceless => motor_state::FORCELESS,
        }
    }
}

pub(crate) fn run(session: &mut Session, args: &StateArgs) -> Result<(), Failure> {
    let mut arm = session.connect()?;
    if let Some(wanted) = args.state {
        change(&mut arm, wanted, args.yes)?;
    }
    session.output.show(&Registers::from(entries(&arm.read_span(Span::of(&MOTOR_STATE))?)))
}

fn change(arm: &mut Arm, wanted: Wanted, yes: bool) -> Result<(), Failure> {
    let present = arm.read_span(Span::of(&MOTOR_STATE))?.byte(&MOTOR_STATE);
    if present == motor_state::SERVO && wanted.code() != motor_state::SERVO {
        let how = if matches!(wanted, Wanted::Damping) { "sink" } else { "fall" };
        confirm(&format!("The arm will {how} unless somebody holds it. Go on?"), yes)?;
    }
    or_hold(arm, |arm, _| motors_obey(arm.write_checked(MOTOR_STATE.address, &[wanted.code()])))
}
