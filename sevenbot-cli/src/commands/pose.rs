//! `pose`, `home`: move joints to targets, with a speed or duration, and optionally wait.

use std::io::{self, Write};
use std::str::FromStr;

use clap::{ArgAction, Args};
use serde::Serialize;
use sevenbot::fine::FineTargets;
use sevenbot::joints::JointSnapshot;
use sevenbot::map::TARGET_POSITION;
use sevenbot::moves::{JointMove, Pace, PaceBefore};
use sevenbot::register_text::joints;
use sevenbot::{Angle, Arm, FineAngle, Joint, MoveTime, Speed};

use crate::command_error::CommandError;
use crate::guard_args::GuardArgs;
use crate::interrupt::{Interrupt, hold_on_interrupt};
use crate::printer::{Printable, note, warn};
use crate::session::Session;
use crate::step_target::{out_of_range, step_target};
use crate::watch::{ProgressWatch, note_other_pace, note_rounding};

/// Move joints to a pose.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot pose 90 90 65 90 90 90 80  the standard pose, also `sevenbot home`
  sevenbot pose 120 90 65 90 90 90 80 --speed 57deg/s
  sevenbot pose +10 _ -5 _ _ _ _ --wait
                                      joint 1 up, joint 3 down, the others as
                                      they are
  sevenbot pose 60 90 65 90 90 90 80 --time 2s --wait
  sevenbot pose 90.25 _ _ _ _ _ +0.5  in hundredths of a degree

Angles take up to two decimals. An arm without hundredths, such as one with the
maker's firmware, goes to the nearest whole degrees, and a note says so.

If the joints would take the arm below the table or into its own base, on the
way too, a warning says so: joints go where they are sent. `sevenbot move-to`
refuses that, and its help describes the guard.

With --wait the speeds and durations of the joints are put back after the move,
also if it fails: then the command waits until the other joints have stopped.
Without it they stay as this command sets them, because another speed would act
at once. A later move without --speed and --time keeps them, and a note says so.

After Ctrl-C the arm holds its position.

Exit status 1 if the arm did not take the pose, or with --wait did not reach it.
If the outcome is unknown, a message says that the arm may be moving. Exit
status 3 if the connection is lost. A joint that does not answer or has let go
takes no pose: nothing is sent then, and the message tells what to do. With
--wait a joint that is blocked on its way ends the wait.")]
pub(crate) struct PoseArgs {
    /// Joints 1 to 7: degrees from 0 to 180, up to two decimals; +N or -N for a step from the present target; _ or . for no change.
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
    /// Speed of these joints, as the register has it: 1 to 100 steps of 1.9 degrees per second, or 0 for the motors'
    /// maximum. Or in degrees per second, 2deg/s to 190deg/s: the nearest step that is not faster.
    #[arg(long, value_name = "STEPS|DEG/S", allow_hyphen_values = true, value_parser = speed)]
    speed: Option<Speed>,
    /// Duration of the move, as the register has it: 0 to 100 steps of 100 ms. Or in seconds, 0.1s to 10s: the nearest
    /// step that is not shorter. Sets the speeds to 0, so that it applies.
    #[arg(long, value_name = "STEPS|S", conflicts_with = "speed", allow_hyphen_values = true, value_parser = time)]
    time: Option<MoveTime>,
    /// Wait until the joints have arrived.
    #[arg(long)]
    wait: bool,
    #[command(flatten)]
    guard: GuardArgs,
}

impl PaceArgs {
    /// The pace. The parsers of the arguments have refused values out of range.
    const fn pace(&self) -> Pace {
        Pace { speed: self.speed, time: self.time }
    }

    /// Does the speed or the duration apply to this move only? Only a command that waits can restore the old values.
    const fn is_for_this_move(&self) -> bool {
        self.wait && (self.speed.is_some() || self.time.is_some())
    }
}

/// Parses a speed, as 30 or 57deg/s: the nearest step that is not faster.
fn speed(text: &str) -> Result<Speed, &'static str> {
    let speed = match text.strip_suffix("deg/s") {
        None => text.parse().ok().and_then(Speed::from_steps),
        Some(number) => number.parse().ok().and_then(Speed::at_most),
    };
    speed.ok_or(
        "a speed from 0 to 100 steps of 1.9 degrees per second, as 30, or in degrees per second, as 57deg/s",
    )
}

/// Parses a duration, as 20 or 2s: the nearest step that is not shorter.
fn time(text: &str) -> Result<MoveTime, &'static str> {
    let time = match text.strip_suffix('s') {
        None => text.parse().ok().and_then(MoveTime::from_steps),
        Some(number) => number.parse().ok().and_then(MoveTime::at_least),
    };
    time.ok_or("a duration from 0 to 100 steps of 100 ms, as 20, or in seconds, as 2s")
}

/// The argument for one joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PoseArg {
    At(FineAngle),
    /// Hundredths of a degree.
    By(i32),
    Leave,
}

impl FromStr for PoseArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            "use degrees from 0 to 180 with up to two decimals, +N or -N for a step, _ or . for no change"
                .to_owned()
        };
        let angle = |text: &str| text.parse::<FineAngle>().map_err(|_| wrong());
        match text.as_bytes() {
            [b'_' | b'.'] => Ok(Self::Leave),
            // No step is longer than the whole range.
            [sign @ (b'+' | b'-'), ..] => {
                let hundredths = i32::from(angle(text.get(1..).unwrap_or_default())?.hundredths());
                Ok(Self::By(if *sign == b'-' { -hundredths } else { hundredths }))
            }
            _ => angle(text).map(Self::At),
        }
    }
}

impl PoseArg {
    /// The target; `None` for no change. A step starts from `base`.
    fn target(
        self,
        joint: Joint,
        joints: &JointSnapshot,
        base: FineAngle,
    ) -> Result<Option<FineAngle>, CommandError> {
        let Self::By(step) = self else {
            return Ok(if let Self::At(angle) = self { Some(angle) } else { None });
        };
        // Fails if the joint does not answer, or may still have its target of power-up.
        step_target(joints, joint, 0)?;
        let hundredths = i32::from(base.hundredths()).saturating_add(step);
        let angle = u16::try_from(hundredths).ok().and_then(FineAngle::from_hundredths);
        angle.map(Some).ok_or_else(|| out_of_range(joint, f64::from(hundredths) / 100.0))
    }
}

pub(crate) fn run(session: &mut Session, args: &PoseArgs) -> Result<(), CommandError> {
    move_to(session, &args.angles, &args.pace)
}

pub(crate) fn home(session: &mut Session, args: &HomeArgs) -> Result<(), CommandError> {
    move_to(
        session,
        &TARGET_POSITION.default_bytes().map(|degrees| PoseArg::At(Angle::from_register(degrees).into())),
        &args.pace,
    )
}

fn move_to(session: &mut Session, goals: &[PoseArg], pace: &PaceArgs) -> Result<(), CommandError> {
    let mut arm = session.connect_to_move()?;
    let mut before = None;
    let reached = hold_on_interrupt(&mut arm, |arm, interrupt| {
        let targets = targets(goals, arm)?;
        pace.guard.warn_of_way(arm, &targets, pace.pace())?;
        if pace.pace() == Pace::default() {
            note_other_pace(arm, &targets)?;
        }
        before = pace.is_for_this_move().then(|| PaceBefore::read(arm, &targets)).transpose()?;
        interrupt.check()?;
        let reached = go(arm, targets, pace, interrupt);
        if let (Err(error), Some(before)) = (&reached, &before) {
            wait_for_rest(arm, before, error, interrupt);
        }
        reached?.map(|whole| measured(arm, goals, whole)).transpose()
    });
    if let Some(before) = before {
        put_back(&mut arm, &before, &reached)?;
    }
    match reached? {
        None => Ok(()),
        Some(ReachedPose::Degrees(positions_degrees)) => {
            session.printer.print(&Positions { positions_degrees })
        }
        Some(ReachedPose::Hundredths(positions)) => session.printer.print(&positions),
    }
}

/// Starts the move, and with --wait waits for its end. Returns the positions in whole degrees; `None` without --wait.
fn go(
    arm: &mut Arm,
    targets: FineTargets,
    pace: &PaceArgs,
    interrupt: Interrupt,
) -> Result<Option<[u8; 7]>, CommandError> {
    let begun = JointMove::begin_at_pace(arm, targets, pace.pace())?;
    note_rounding(&begun);
    Ok(pace.wait.then(|| begun.finish(arm, &mut ProgressWatch::new(interrupt))).transpose()?)
}

/// After a failure: waits until the other joints rest, because another speed would act on them at once. Ctrl-C ends the wait,
/// and the arm then holds.
fn wait_for_rest(arm: &mut Arm, before: &PaceBefore, error: &CommandError, interrupt: Interrupt) {
    if Interrupt::is_requested() {
        return;
    }
    if let (Ok(moving @ 1..), Some(error)) = (before.moving(arm), error.message()) {
        note(format_args!(
            "{error}. Still moving: {}. This command waits for the end of that, and then puts the speeds back; Ctrl-C stops the arm",
            joints(moving)
        ));
    }
    // If this wait fails, other than by Ctrl-C, `put_back` fails for the same reason, and warns.
    let _ = before.wait_for_rest(arm, &mut ProgressWatch::new(interrupt));
}

/// Puts the speeds and durations back. If the move has failed already, a failure here is only a warning.
fn put_back<T>(
    arm: &mut Arm,
    before: &PaceBefore,
    reached: &Result<T, CommandError>,
) -> Result<(), CommandError> {
    let restored = match reached {
        // The arm was told to hold. Do not wait: the duration of the move to the held position may still run.
        Err(CommandError::Interrupted | CommandError::Problems(_)) if Interrupt::is_requested() => {
            before.put_back_at_once(arm)
        }
        _ => before.put_back(arm),
    };
    match restored {
        Err(error) if reached.is_err() => {
            warn(format_args!(
                "the speeds and durations of the joints are still those of this command: {error}; `sevenbot get speed time` \
                 shows them, and `sevenbot set` changes them"
            ));
            Ok(())
        }
        done => Ok(done?),
    }
}

/// Measured positions, in the resolution of the arguments.
enum ReachedPose {
    Degrees([u8; 7]),
    Hundredths(FinePositions),
}

/// The positions in hundredths if an argument has a fraction and the arm measures hundredths; otherwise `whole`.
fn measured(arm: &mut Arm, goals: &[PoseArg], whole: [u8; 7]) -> Result<ReachedPose, CommandError> {
    let is_whole = goals.iter().all(|goal| match goal {
        PoseArg::At(angle) => angle.is_whole(),
        PoseArg::By(hundredths) => hundredths % 100 == 0,
        PoseArg::Leave => true,
    });
    if is_whole || !arm.has_extended_block()? {
        return Ok(ReachedPose::Degrees(whole));
    }
    let mut positions_degrees = whole.map(f64::from);
    for (degrees, angle) in positions_degrees.iter_mut().zip(arm.fine_state()?.positions) {
        *degrees = angle.map_or(*degrees, FineAngle::degrees);
    }
    Ok(ReachedPose::Hundredths(FinePositions { positions_degrees }))
}

fn targets(goals: &[PoseArg], arm: &mut Arm) -> Result<FineTargets, CommandError> {
    let joints = arm.driven_joints()?;
    let is_step = goals.iter().any(|goal| matches!(goal, PoseArg::By(_)));
    let bases = match is_step && arm.has_extended_block()? {
        true => arm.fine_targets()?,
        false => joints.targets().map(|degrees| Angle::from_register(degrees).into()),
    };
    let mut targets = [None; 7];
    for (((target, goal), joint), base) in targets.iter_mut().zip(goals).zip(Joint::ALL).zip(bases) {
        *target = goal.target(joint, &joints, base)?;
    }
    Ok(targets)
}

#[derive(Serialize)]
pub(crate) struct Positions {
    pub(crate) positions_degrees: [u8; 7],
}

impl Printable for Positions {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.positions_degrees.map(|degrees| degrees.to_string()).join(" "))
    }
}

/// Positions of the joints, in degrees with two decimals.
#[derive(Serialize)]
pub(crate) struct FinePositions {
    pub(crate) positions_degrees: [f64; 7],
}

impl Printable for FinePositions {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.positions_degrees.map(|degrees| format!("{degrees:.2}")).join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_and_durations_are_steps_or_have_a_unit() {
        let steps_of = |text| speed(text).map(Speed::steps).ok();
        assert_eq!(["30", "57deg/s", "58deg/s", "0"].map(steps_of), [Some(30), Some(30), Some(30), Some(0)]);
        assert_eq!(["190deg/s", "191deg/s", "0deg/s", "101", "2x", "40mm/s"].map(steps_of)[1..], [None; 5]);
        let steps_of = |text| time(text).map(MoveTime::steps).ok();
        assert_eq!(["20", "2s", "0.5s", "10s"].map(steps_of), [Some(20), Some(20), Some(5), Some(100)]);
        assert_eq!(["101", "11s", "2ms", "s", "NaNs"].map(steps_of), [None; 5]);
    }

    #[test]
    fn pose_arguments_are_absolute_relative_or_empty() {
        let at = |hundredths| FineAngle::from_hundredths(hundredths).map(PoseArg::At);
        assert_eq!("120".parse().ok(), at(12_000));
        assert_eq!("90.25".parse().ok(), at(9_025));
        assert_eq!("+10".parse(), Ok(PoseArg::By(1_000)));
        assert_eq!("-0.5".parse(), Ok(PoseArg::By(-50)));
        assert_eq!("_".parse(), Ok(PoseArg::Leave));
        assert_eq!(".".parse(), Ok(PoseArg::Leave));
        for text in ["181", "", "+", "_5", "9.555", "--5", "+-5", "9.", "NaN"] {
            assert!(text.parse::<PoseArg>().is_err(), "{text}");
        }
    }
}
