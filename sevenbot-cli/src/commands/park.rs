//! `park`: moves the arm to a pose in which it may be let go, and lets it go.

use clap::{ArgAction, Args};
use sevenbot::fine::FineTargets;
use sevenbot::moves::ParkError;
use sevenbot::{Arm, FineAngle, park_poses};

use super::pose::FinePositions;
use crate::command_error::CommandError;
use crate::interrupt::hold_on_interrupt;
use crate::printer::note;
use crate::session::Session;
use crate::watch::ProgressWatch;

/// Move the arm to a pose in which it may be let go, and let it go.
///
/// Moves slowly, then switches the motors to damping (motor state 0) and watches: for 2 seconds in the standard pose, and for 15 in
/// another one. If a joint sinks by more than 2 degrees, or still sinks after 5 seconds, the motors hold the arm again, and the
/// command fails.
#[derive(Debug, Args)]
#[command(after_help = "\
Without angles the arm goes to the pose that was kept for it with --keep, or
else to the standard park pose: rear arm upright, forearm folded up, tool
pointing up (joint 2 at 90, joint 3 at 0, joint 4 at 90, joint 5 at 48 degrees;
the others stay). There friction holds every joint of an arm with an empty
gripper. Make sure that nothing is above and behind the arm.

Damping and not forceless: a joint that is loaded after all sinks slowly, is
noticed, and is held again.

A kept pose belongs to one arm, by its chip id. It is a line in
$XDG_CONFIG_HOME/7bot/park-poses, or in ~/.config/7bot/park-poses; on Windows in
%APPDATA%\\7bot\\park-poses.

Examples:
  sevenbot park
  sevenbot park _ 95 0 _ 50 _ _ --keep
                            this arm parks here from now on
  sevenbot park --standard  the standard pose, although another one is kept

`sevenbot state servo` makes the arm hold again, where it is.

Exit status 1 if the arm does not get to the pose, or does not stay there.")]
pub(crate) struct ParkArgs {
    /// Joints 1 to 7: degrees from 0 to 180, up to two decimals; _ for no change.
    #[arg(value_names = ["A1", "A2", "A3", "A4", "A5", "A6", "A7"], num_args = 7, action = ArgAction::Set,
          value_parser = angle)]
    angles: Option<Vec<Option<FineAngle>>>,
    /// Keep this pose for this arm, once it has parked there.
    #[arg(long, requires = "angles", conflicts_with = "standard")]
    keep: bool,
    /// The standard park pose, also if another one is kept.
    #[arg(long, conflicts_with = "angles")]
    standard: bool,
}

fn angle(text: &str) -> Result<Option<FineAngle>, String> {
    match text {
        "_" | "." => Ok(None),
        text => text.parse().map(Some).map_err(|error: sevenbot::fine_angle::NoAngle| error.to_string()),
    }
}

pub(crate) fn run(session: &mut Session, args: &ParkArgs) -> Result<(), CommandError> {
    let mut arm = session.connect_to_move()?;
    let pose = pose(&arm, args)?;
    let parked =
        hold_on_interrupt(
            &mut arm,
            |arm, interrupt| Ok(arm.park(pose, &mut ProgressWatch::new(interrupt))?),
        )?;
    if let (true, Some(pose)) = (args.keep, &pose) {
        keep(&arm, pose)?;
    }
    note("parked: the motors are in damping protection, and the arm stays");
    session.printer.print(&FinePositions { positions_degrees: parked.map(FineAngle::degrees) })
}

fn pose(arm: &Arm, args: &ParkArgs) -> Result<Option<FineTargets>, CommandError> {
    if let Some(angles) = &args.angles {
        return Ok(angles.clone().try_into().ok());
    }
    match park_poses::path() {
        Some(path) if !args.standard => park_poses::load(&path, &arm.identity().chip_name())
            .map_err(|error| CommandError::file(&path, error)),
        _ => Ok(None),
    }
}

fn keep(arm: &Arm, pose: &FineTargets) -> Result<(), CommandError> {
    let no_directory = || CommandError::Arm(format!("parked, but not kept: {}", park_poses::NO_DIRECTORY));
    let path = park_poses::path().ok_or_else(no_directory)?;
    park_poses::keep(&path, &arm.identity().chip_name(), pose)
        .map_err(|error| CommandError::file(&path, error))?;
    note(format_args!("this arm parks here from now on ({})", path.display()));
    Ok(())
}

impl From<ParkError> for CommandError {
    fn from(error: ParkError) -> Self {
        match error {
            ParkError::Move(error) => error.into(),
            sinks @ ParkError::Sinks { .. } => Self::Arm(sinks.to_string()),
        }
    }
}
