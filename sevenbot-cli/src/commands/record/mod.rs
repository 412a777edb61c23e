//! `record`: writes the positions of a guided or moving arm to a file.
//!
//! ```text
//!   arm ── reports ──▶ Recorder (time of measurement) ──▶ one line each ──▶ file
//!                       TeachPendant (keys: pump, nudges, end) ──┘
//! ```
//!
//! After any end the file has whole lines, and an arm that is still connected holds its position.

mod teach_pendant;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, value_parser};
use serde::Serialize;
use sevenbot::health::ProblemKind;
use sevenbot::map::{MOTOR_STATE, VACUUM_PUMP, motor_state, report_content};
use sevenbot::moves::{ConnectionLost, RecordedPose, Recorder};
use sevenbot::recording::{FileVersion, Moment, RecordingLines};
use sevenbot::{Arm, Problem, Span};

use self::teach_pendant::TeachPendant;
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::interrupt::{Interrupt, hold, report_hold};
use crate::line_file::LineFile;
use crate::printer::{Printable, note};
use crate::session::Session;

/// Record a movement: guide the arm by hand, or let it move.
///
/// The motors go off so that you can guide the arm, and its positions go to FILE. Ctrl-C ends the recording, and the
/// arm holds its pose, also with --driven. On a terminal v switches the vacuum pump, and the space bar ends
/// the recording as Ctrl-C does.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot record wave.txt  hold the arm, answer y, guide it; Ctrl-C ends
  sevenbot record wave.txt --driven
                            the motors stay on, the arrow keys move the arm
  sevenbot pose 150 60 90 90 90 90 80 --speed 10
  sevenbot record move.txt --driven --seconds 5
                            records a move

The file is text, one line per moment: seconds, seven angles in degrees, vacuum.
Angles have two decimals if the arm measures them. `sevenbot play` plays it, and
also a file written by hand.

Exit status 1 if a servo does not answer, because the joint's position is
unknown then, or if the controller restarts. The file has what was recorded
before.")]
pub(crate) struct RecordArgs {
    /// The file for the recording.
    file: PathBuf,
    /// End after N seconds.
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=86_400))]
    seconds: Option<u32>,
    /// Moments per second.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = value_parser!(u8).range(1..=50))]
    hz: u8,
    /// Leave the motors on, to record a move of the arm or one made with keys.
    #[arg(long)]
    driven: bool,
    /// Do not ask whether the arm is held and FILE may be replaced.
    #[arg(long)]
    yes: bool,
}

/// The longest reaction time to a key or Ctrl-C.
const POLL_PERIOD: Duration = Duration::from_millis(20);

/// The result of `record`.
#[derive(Debug, Serialize)]
struct Recorded {
    file: String,
    moments: u64,
    seconds: f64,
}

impl Printable for Recorded {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}: {} moments in {:.1} s", self.file, self.moments, self.seconds)
    }
}

pub(crate) fn run(session: &mut Session, args: &RecordArgs) -> Result<(), CommandError> {
    if args.file.as_os_str() == "-" {
        let reason = "- is no name of a file: to record to standard output, use /dev/stdout";
        return Err(CommandError::Usage(reason.to_owned()));
    }
    let mut arm = session.connect_to_move()?;
    if args.file.is_file() {
        confirm(&format!("{} exists. Replace it?", args.file.display()), args.yes)?;
    }
    if args.driven {
        arm.driven_joints()?;
    } else {
        confirm("The motors go off, and the arm falls unless you hold it. Go on?", args.yes)?;
    }
    let content = arm.exact_positions()?;
    let version = match content {
        report_content::POSITIONS => FileVersion::Degrees,
        _ => FileVersion::Hundredths,
    };
    let mut recording = RecordingFile::create(&args.file, version)?;
    Interrupt::catch();
    let before = arm.joints()?;
    let done = set_motors(&mut arm, args).and_then(|()| {
        arm.with_reports(args.hz, content, |arm| {
            // A restart would drive the joints of an arm that is to be guided.
            if arm.joints()?.has_restarted_since(&before) {
                return Err(CommandError::Problems(vec![Problem::of_arm(ProblemKind::Restarted)]));
            }
            record_reports(arm, args, content, &mut recording)
        })
    });
    // Without a connection the arm cannot be made to hold.
    let is_gone = done.as_ref().is_err_and(CommandError::is_connection_lost);
    let held = if is_gone && !Interrupt::is_requested() { Ok(()) } else { hold_at_end(&mut arm, args) };
    let (moments, seconds) = (recording.lines.count(), recording.lines.duration().as_secs_f64());
    let recorded = Recorded { file: args.file.display().to_string(), moments, seconds };
    if done.is_err() {
        note(format_args!("{} is complete up to {seconds:.1} s, {moments} moments", recorded.file));
    }
    done.and(held)?;
    session.printer.print(&recorded)
}

/// Switches the motors off if the user guides the arm.
fn set_motors(arm: &mut Arm, args: &RecordArgs) -> Result<(), CommandError> {
    let state = if args.driven { motor_state::SERVO } else { motor_state::FORCELESS };
    Ok(arm.write_motion(MOTOR_STATE.address, &[state])?)
}

/// Makes a guided arm hold its pose. A driven arm finishes its move, but holds after Ctrl-C.
fn hold_at_end(arm: &mut Arm, args: &RecordArgs) -> Result<(), CommandError> {
    if args.driven {
        if Interrupt::is_requested() {
            report_hold(&hold(arm)?);
        }
        return Ok(());
    }
    // The targets become the measured positions (D13).
    arm.engage_and_watch()?;
    note("the arm holds where it is");
    Ok(())
}

/// Records reports until the end is requested.
fn record_reports(
    arm: &mut Arm,
    args: &RecordArgs,
    content: u8,
    recording: &mut RecordingFile,
) -> Result<(), CommandError> {
    let vacuum = arm.read_span(Span::of(&VACUUM_PUMP))?.byte(&VACUUM_PUMP) != 0;
    let mut pendant = TeachPendant::new(arm.targets()?, vacuum, args.driven);
    let mut recorder = Recorder::new(arm, args.hz, content);
    let limit = args.seconds.map(|seconds| Duration::from_secs(seconds.into()));
    while !Interrupt::is_requested() && !pendant.poll_keys(arm)? {
        let Some(RecordedPose { time, pose, .. }) = recorder.next(arm, POLL_PERIOD)? else { continue };
        if limit.is_some_and(|limit| time > limit) {
            break;
        }
        recording.add(&Moment { time, pose, vacuum: pendant.vacuum() })?;
        pendant.show(recording.lines.count(), time);
    }
    Ok(())
}

/// The file, and the lines of the recording so far.
struct RecordingFile {
    file: LineFile,
    lines: RecordingLines,
}

impl RecordingFile {
    fn create(path: &Path, version: FileVersion) -> Result<Self, CommandError> {
        let (mut file, lines) = (LineFile::create(path)?, RecordingLines::new(version));
        file.add(&lines.head())?;
        Ok(Self { file, lines })
    }

    fn add(&mut self, moment: &Moment) -> Result<(), CommandError> {
        self.lines.add(moment).map_or(Ok(()), |line| self.file.add(&line))
    }
}
