//! `--table` and `--no-guard`: the guard of the workspace at the command line.
//!
//! A move of the tip that the guard does not allow is an error with advice. `pose`, `home`, `play`, `stream` and the monitor's
//! nudges only warn.

use clap::Args;
use sevenbot::cartesian::{Guard, StraightLineError, StraightLineFault, TipRefusal, Vector};
use sevenbot::fine::FineTargets;
use sevenbot::moves::{GuardedMoveError, Pace};
use sevenbot::{Arm, Error};

use crate::command_error::CommandError;
use crate::printer::warn;

/// The options of the guard.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(crate) struct GuardArgs {
    /// Height of the table in millimetres, for the guard. The foot of the base is at -60, which is the default.
    #[arg(long, value_name = "Z", allow_negative_numbers = true, value_parser = millimetres)]
    table: Option<f64>,
    /// No guard: the arm may go below the table and into its own base.
    #[arg(long, conflicts_with = "table")]
    no_guard: bool,
}

/// Advice after a refusal.
const OPTIONS: &str = "--table Z sets the height of the table, in millimetres above the top plate: -60 is the foot of the base, \
                       and less where the arm stands on a block";
const SWITCH: &str =
    "--no-guard switches the guard off: nothing then keeps the arm from its base and the table";
const ADVICE: [&str; 2] = [OPTIONS, SWITCH];
const ADVICE_ON_THE_WAY: [&str; 3] =
    ["go to a point above first; or use --straight, where the tip takes no curve", OPTIONS, SWITCH];

/// A finite number of millimetres.
pub(crate) fn millimetres(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| "a number, such as 185 or -50.5".to_owned())
}

impl GuardArgs {
    /// The guard; `None` if it is switched off.
    pub(crate) fn guard(&self) -> Option<Guard> {
        (!self.no_guard).then(|| self.table.map_or_else(Guard::default, Guard::above))
    }

    /// Fails if the guard does not allow the way of the joints to these targets.
    pub(crate) fn check_way(&self, arm: &mut Arm, targets: &FineTargets) -> Result<(), CommandError> {
        let Some(guard) = self.guard() else { return Ok(()) };
        arm.check_way(targets, Pace::default(), &guard).map_err(|error| match error {
            GuardedMoveError::Exchange(error) => error.into(),
            GuardedMoveError::Guarded(breach) => CommandError::WithAdvice {
                message: format!("the way there is not allowed: {breach}; nothing was moved"),
                advice: if breach.share < 1.0 { &ADVICE_ON_THE_WAY } else { &ADVICE },
            },
        })
    }

    /// Warns if the guard would not allow the way of the joints to these targets.
    pub(crate) fn warn_of_way(&self, arm: &mut Arm, targets: &FineTargets, pace: Pace) -> Result<(), Error> {
        let Some(guard) = self.guard() else { return Ok(()) };
        match arm.check_way(targets, pace, &guard) {
            Ok(()) => Ok(()),
            Err(GuardedMoveError::Exchange(error)) => Err(error),
            Err(GuardedMoveError::Guarded(breach)) => {
                warn_of(&breach);
                Ok(())
            }
        }
    }
}

/// Warns of something that the guard would not allow.
pub(crate) fn warn_of(breach: &dyn std::fmt::Display) {
    warn(format_args!("{breach}. --table sets the height of the table; --no-guard ends this warning"));
}

/// The error for a refused position of the tip. With advice if the guard refused it.
pub(crate) fn refused(reason: &TipRefusal) -> CommandError {
    let other = reason.other_tool().map(|Vector { x, y, z }| {
        let reaches = if matches!(reason, TipRefusal::Guarded(_)) { "may go to" } else { "reaches" };
        format!(". With --tool {x} {y} {z} the tip {reaches} the point")
    });
    let message = format!("{reason}{}; nothing was moved", other.unwrap_or_default());
    match reason {
        TipRefusal::Unreachable(_) => CommandError::Arm(message),
        TipRefusal::Guarded(_) => CommandError::WithAdvice { message, advice: &ADVICE },
    }
}

/// The error for a refused straight line. With advice if the guard refused it.
pub(crate) fn refused_line(reason: &StraightLineError) -> CommandError {
    let message = format!("{reason}; nothing was moved");
    match reason.fault {
        StraightLineFault::Guarded(_) => CommandError::WithAdvice { message, advice: &ADVICE },
        _ => CommandError::Arm(message),
    }
}
