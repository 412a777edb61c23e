//! `play`: moves the arm along a recording, and plots the result.
//!
//! ```text
//!   file ──▶ check ──▶ Player ──▶ measured positions ──▶ plot
//! ```

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use serde::Serialize;
use sevenbot::Arm;
use sevenbot::approach::ApproachRule;
use sevenbot::moves::Player;
use sevenbot::recording::Recording;

use crate::approach_args::ApproachArgs;
use crate::command_error::CommandError;
use crate::guard_args::{GuardArgs, warn_of};
use crate::input_file;
use crate::interrupt::hold_on_interrupt;
use crate::output_file::{ForceArg, OutputFile};
use crate::plot::{self, JointTrack};
use crate::printer::{Printable, warn};
use crate::session::Session;
use crate::watch::{ProgressWatch, note_rounding_of};

/// Play a recorded movement.
///
/// Before the arm moves, the whole file is checked, and each joint has to stand within 5 degrees of where the file begins. Ctrl-C
/// makes the arm hold its position.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot play wave.txt
  sevenbot play wave.txt --approach 3     goes to the first pose in 3 s
  sevenbot play wave.txt --speed 0.5x --loop=3
  sevenbot play wave.txt --plot wave.svg  plots targets and measured positions

An arm with this project's firmware gets a point in hundredths of a degree each
20 ms, and its watchdog makes it hold if this program dies. Others get whole
degrees and speeds each 50 ms.

A first pose within 5 degrees is approached at 30 degrees per second. Further
away it is refused with the distance of each joint, unless --approach goes there
first; with --loop, the same holds for the way from the last pose to the first.

A recording that leads below the table or into the base is played with a
warning; `sevenbot move-to --help` describes this guard.")]
pub(crate) struct PlayArgs {
    /// A recording of `sevenbot record`, or one written by hand; - is standard input.
    file: PathBuf,
    /// Speed as a factor, 0.1x to 10x.
    #[arg(long, value_name = "FACTOR", default_value = "1x", allow_hyphen_values = true, value_parser = factor)]
    speed: f64,
    /// Repeat without end, or N times in all.
    #[arg(long = "loop", value_name = "N", num_args = 0..=1, require_equals = true,
          default_missing_value = ENDLESS, value_parser = times)]
    times: Option<u32>,
    /// Write an SVG plot of the targets and the measured positions of the first run.
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    force: ForceArg,
    #[command(flatten)]
    approach: ApproachArgs,
    #[command(flatten)]
    guard: GuardArgs,
}

#[derive(Debug, Serialize)]
struct Played {
    times: u32,
    seconds: f64,
}

impl Printable for Played {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let Self { times, seconds, .. } = self;
        let times = if *times == 1 { String::new() } else { format!(", {times} times") };
        writeln!(out, "played {seconds:.1} s{times}")
    }
}

pub(crate) fn run(session: &mut Session, args: &PlayArgs) -> Result<(), CommandError> {
    let recording = load(args)?;
    // Open the plot file first, so that a wrong path fails before anything moves.
    let drawn = args.plot.as_ref().map(|path| OutputFile::open(path, Some(&args.file), args.force));
    let drawn = drawn.transpose()?;
    if let Some(breach) = args.guard.guard().and_then(|guard| guard.check_recording(&recording).err()) {
        warn_of(&breach);
    }
    let mut arm = session.connect_to_move()?;
    arm.driven_joints()?;
    note_rounding_of(&recording, &mut arm)?;
    let mut player = Player::new(&recording, args.speed).with_approach(args.approach.rule());
    let done = play(&mut player, &mut arm, args.times.unwrap_or(1));
    let drawn = drawn.map_or(Ok(()), |file| file.write(drawing(&recording, &player, args).as_bytes()));
    done?;
    drawn?;
    let seconds = recording.duration().as_secs_f64() / args.speed;
    session.printer.print(&Played { times: player.played(), seconds })
}

/// Plays, once, a recording that was planned from the arm's present targets. Then restores the arm's speeds and times.
pub(super) fn follow(arm: &mut Arm, recording: &Recording) -> Result<(), CommandError> {
    arm.driven_joints()?;
    play(&mut Player::new(recording, 1.0).with_approach(ApproachRule::Slowly), arm, 1)
}

fn play(player: &mut Player, arm: &mut Arm, times: u32) -> Result<(), CommandError> {
    let played = hold_on_interrupt(arm, |arm, interrupt| {
        Ok(player.play(arm, times, &mut ProgressWatch::new(interrupt))?)
    });
    if player.has_left_pace() {
        warn(
            "the speeds and durations of the joints may still be those of the recording, and a speed of 0 is the motors' \
             maximum: `sevenbot get speed time` shows them, and `sevenbot set` changes them",
        );
    }
    played
}

/// Reads the recording, and checks that an arm can follow it.
fn load(args: &PlayArgs) -> Result<Recording, CommandError> {
    let recording = input_file::recording(&args.file)?;
    recording.check_speeds(args.speed).map_err(|error| CommandError::file(&args.file, error))?;
    Ok(recording)
}

/// Parses a factor, as 2x or 2.
fn factor(text: &str) -> Result<f64, &'static str> {
    let number = text.strip_suffix('x').unwrap_or(text);
    let factor = number.parse().ok().filter(|factor| (0.1..=10.0).contains(factor));
    factor.ok_or("a factor from 0.1 to 10, as 2x or 2")
}

/// The value of `--loop` without a number.
const ENDLESS: &str = "endless";

/// Parses how many times to play; 0 means without end.
fn times(text: &str) -> Result<u32, &'static str> {
    if text == ENDLESS {
        return Ok(0);
    }
    text.parse()
        .ok()
        .filter(|&times| times > 0)
        .ok_or("a number of times, 1 or more; without a number, no end")
}

/// Targets and measured positions as SVG.
fn drawing(recording: &Recording, player: &Player, args: &PlayArgs) -> String {
    let mut tracks: [JointTrack; 7] = Default::default();
    let start = recording.moments().next().map_or(Duration::ZERO, |moment| moment.time);
    for moment in recording.moments() {
        let seconds = (moment.time.saturating_sub(start)).as_secs_f64() / args.speed;
        for (track, angle) in tracks.iter_mut().zip(moment.pose) {
            track.target.push((seconds, angle.degrees()));
        }
    }
    for (time, pose) in player.measured() {
        for (track, angle) in tracks.iter_mut().zip(pose) {
            track.measured.push((time.as_secs_f64(), angle.degrees()));
        }
    }
    let name = args.file.file_name().unwrap_or_default().to_string_lossy();
    let speed = if args.speed == 1.0 { String::new() } else { format!(", speed {}", args.speed) };
    plot::drawing(&format!("{name}{speed}"), &tracks)
}
