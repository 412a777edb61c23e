//! `state`: shows or changes the motor state. Asks before the arm may fall.

use clap::{Args, ValueEnum};
use sevenbot::map::{MOTOR_STATE, motor_state};
use sevenbot::moves::MoveError;
use sevenbot::register_text::{entries, joints};
use sevenbot::{Arm, Span};

use super::get::RegisterList;
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::interrupt::hold_on_interrupt;
use crate::printer::{note, warn};
use crate::session::Session;

/// Show or change the motor state.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot state                  show the state
  sevenbot state servo            the arm holds its position, and takes targets
  sevenbot state forceless --yes  the arm can be moved by hand; it falls unless
                                  held

`state servo` watches for half a second whether the joints hold. While no servo
answers it writes nothing: the motors stay off when their supply is back.

Exit status 1 if the arm may not have taken the state: it may be moving. Also if
a joint does not hold in state servo: it does not answer or has let go.")]
pub(crate) struct StateArgs {
    /// The new state.
    state: Option<MotorStateArg>,
    /// Do not ask whether the arm is held.
    #[arg(long)]
    yes: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum MotorStateArg {
    /// The motors drive the joints.
    Servo,
    /// The motors brake the joints.
    Damping,
    /// The joints turn freely.
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
    confirm_state(arm, wanted.code(), yes)?;
    hold_on_interrupt(arm, |arm, _| {
        if let MotorStateArg::Servo = wanted {
            return engage(arm);
        }
        arm.write_motion(MOTOR_STATE.address, &[wanted.code()])?;
        warn_about_silent_joints(arm)
    })
}

fn engage(arm: &mut Arm) -> Result<(), CommandError> {
    let engaged = arm.engage_and_watch();
    let is_refused = matches!(engaged, Err(MoveError::Problems(_)));
    if is_refused && arm.joints().is_ok_and(|joints| !joints.is_driven()) {
        note("the motors were not switched on");
    }
    Ok(engaged?)
}

/// Warns about joints without an answer: it is unknown whether their motors are off.
fn warn_about_silent_joints(arm: &mut Arm) -> Result<(), CommandError> {
    let silent = arm.joints()?.missing();
    if silent != 0 {
        let silent = joints(silent);
        warn(format_args!("no answer from the servos of {silent}: it is unknown whether they still hold"));
    }
    Ok(())
}

/// Asks before a driven arm loses its torque.
pub(super) fn confirm_state(arm: &mut Arm, wanted: u8, yes: bool) -> Result<(), CommandError> {
    let present = arm.read_span(Span::of(&MOTOR_STATE))?.byte(&MOTOR_STATE);
    if present != motor_state::SERVO || wanted == motor_state::SERVO {
        return Ok(());
    }
    let how = if wanted == motor_state::DAMPING { "sink" } else { "fall" };
    confirm(&format!("The arm will {how} unless you hold it. Go on?"), yes)
}
