//! `pose`, `home`: move joints to targets, with a speed or duration, and optionally wait.

use std::io::{self, Write};
use std::str::FromStr;

use clap::{ArgAction, Args, value_parser};
use serde::Serialize;
use sevenbot::joints::{JointSnapshot, frames_for};
use sevenbot::map::{SPEED, TARGET_POSITION, TIME};
use sevenbot::{Angle, Arm, Joint, Speed};

use crate::command_error::CommandError;
use crate::interrupt::hold_on_interrupt;
use crate::joint_move::{JointMove, Targets, driven_joints, step_target};
use crate::printer::Printable;
use crate::session::Session;
use crate::write_result::all_taken;

/// Move joints to a pose.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot pose 90 90 65 90 90 90 80               the standard pose, also `sevenbot home`
  sevenbot pose 120 90 65 90 90 90 80 --speed 30   at 57 degrees per second
  sevenbot pose +10 _ -5 _ _ _ _ --wait            joint 1 up, joint 3 down, the others as they are
  sevenbot pose 60 90 65 90 90 90 80 --time 20 --wait

After Ctrl-C the arm holds its position.

Exit status 1 if the arm did not take the pose, or with --wait did not reach it. If that is unknown, the
message says that the arm may be moving.")]
pub(crate) struct PoseArgs {
    /// Joints 1 to 7: degrees from 0 to 180; +N or -N for a step from the present target; _ or . for no change.
    #[arg(value_names = ["A1", "A2", "A3", "A4", "A5", "A6", "A7"], num_args = 7, required = true,
          action = ArgAction::Set, allow_negative_numbers = true)]
    angles: Vec<PoseArg>,
    #[command(flatten)]
    pace: PaceArgs,
}

/// Move all joints to the standard pose.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot home --speed 20 --wait")]
pub(crate) struct HomeArgs {
    #[command(flatten)]
    pace: PaceArgs,
}

#[derive(Debug, Args)]
struct PaceArgs {
    /// Speed of these joints in steps of 1.9 degrees per second, 1 to 100; 0 is the motors' maximum.
    #[arg(long, value_name = "N", value_parser = value_parser!(u8).range(0..=100))]
    speed: Option<u8>,
    /// Duration of the move in steps of 100 ms, 0 to 100. Sets the speeds to 0, so that it applies.
    #[arg(long, value_name = "N", conflicts_with = "speed", value_parser = value_parser!(u8).range(0..=100))]
    time: Option<u8>,
    /// Wait until the joints have arrived.
    #[arg(long)]
    wait: bool,
}

/// The argument for one joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PoseArg {
    At(u8),
    By(i16),
    Leave,
}

impl FromStr for PoseArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "use degrees from 0 to 180, +N or -N for a step, _ or . for no change".to_owned();
        match text.as_bytes() {
            [b'_' | b'.'] => Ok(Self::Leave),
            [b'+' | b'-', ..] => text.parse().map(Self::By).map_err(|_| wrong()),
            _ => text
                .parse()
                .ok()
                .and_then(Angle::from_degrees)
                .map_or_else(|| Err(wrong()), |angle| Ok(Self::At(angle.degrees()))),
        }
    }
}

impl PoseArg {
    /// The target in degrees.
    fn degrees(self, joint: Joint, joints: &JointSnapshot) -> Result<Option<u8>, CommandError> {
        let Self::By(step) = self else {
            return Ok(if let Self::At(degrees) = self { Some(degrees) } else { None });
        };
        let degrees = step_target(joints, joint, step)?;
        let angle = u8::try_from(degrees).ok().and_then(Angle::from_degrees);
        angle.map(|angle| Some(angle.degrees())).ok_or_else(|| {
            let number = joint.number();
            CommandError::Arm(format!(
                "joint {number} would go to {degrees}°: it takes 0 to 180; nothing was moved"
            ))
        })
    }
}

pub(crate) fn run(session: &mut Session, args: &PoseArgs) -> Result<(), CommandError> {
    move_to(session, &args.angles, &args.pace)
}

pub(crate) fn home(session: &mut Session, args: &HomeArgs) -> Result<(), CommandError> {
    move_to(session, &TARGET_POSITION.default_bytes().map(PoseArg::At), &args.pace)
}

fn move_to(session: &mut Session, goals: &[PoseArg], pace: &PaceArgs) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    let reached = hold_on_interrupt(&mut arm, |arm, interrupt| {
        let targets = targets(goals, &driven_joints(arm)?)?;
        set_speed_and_time(arm, &targets, pace)?;
        interrupt.check()?;
        let begun = JointMove::begin(arm, targets)?;
        pace.wait.then(|| begun.finish(arm, interrupt)).transpose()
    })?;
    reached.map_or(Ok(()), |positions_degrees| session.printer.print(&Positions { positions_degrees }))
}

fn targets(goals: &[PoseArg], joints: &JointSnapshot) -> Result<Targets, CommandError> {
    let mut targets = [None; 7];
    for ((target, goal), joint) in targets.iter_mut().zip(goals).zip(Joint::ALL) {
        *target = goal.degrees(joint, joints)?;
    }
    Ok(targets)
}

/// Sets speed and duration of the joints with a target.
fn set_speed_and_time(arm: &mut Arm, targets: &Targets, pace: &PaceArgs) -> Result<(), CommandError> {
    let for_targets = |steps: u8| targets.map(|target| target.map(|_| steps));
    let speed = pace.speed.or(pace.time.map(|_| Speed::MAXIMUM.steps()));
    let speeds = speed.map(|steps| frames_for(&SPEED, &for_targets(steps)));
    let times = pace.time.map(|steps| frames_for(&TIME, &for_targets(steps)));
    let frames: Vec<_> = speeds.into_iter().chain(times).flatten().collect();
    if frames.is_empty() { Ok(()) } else { all_taken(&arm.write_all_checked(&frames)?) }
}

/// Positions of the joints.
#[derive(Serialize)]
pub(crate) struct Positions {
    pub(crate) positions_degrees: [u8; 7],
}

impl Printable for Positions {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.positions_degrees.map(|degrees| degrees.to_string()).join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pose_arguments_are_absolute_relative_or_empty() {
        assert_eq!("120".parse(), Ok(PoseArg::At(120)));
        assert_eq!("+10".parse(), Ok(PoseArg::By(10)));
        assert_eq!("-10".parse(), Ok(PoseArg::By(-10)));
        assert_eq!("_".parse(), Ok(PoseArg::Leave));
        assert_eq!(".".parse(), Ok(PoseArg::Leave));
        for text in ["181", "", "+", "_5", "9.5", "--5"] {
            assert!(text.parse::<PoseArg>().is_err(), "{text}");
        }
    }
}
