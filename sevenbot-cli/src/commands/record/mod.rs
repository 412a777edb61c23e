//! `record`: writes the positions of a guided or moving arm to a file.
//!
//! ```text
//!   arm ── reports ──▶ Recorder (time of measurement) ──▶ one line each ──▶ RecordingOutputs: text, MCAP
//!    │                  TeachPendant (keys: pump, nudges, end) ──┘              ▲
//!    └── reads ───────▶ TelemetryReader (targets, velocities, loads, health) ───┘ MCAP only
//! ```
//!
//! However the recording ends, the files hold whole moments only. Unless the program is killed or a second Ctrl-C ends it, a guided
//! arm that is still connected then holds its position.

mod outputs;
mod teach_pendant;
mod telemetry;

use std::fmt;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use clap::{ArgGroup, Args, value_parser};
use recording_formats::{Format, Telemetry};
use serde::Serialize;
use sevenbot::health::ProblemKind;
use sevenbot::map::{MOTOR_STATE, VACUUM_PUMP, motor_state, report_content};
use sevenbot::moves::{ConnectionLost, RecordedPose, Recorder};
use sevenbot::recording::{FileVersion, Moment};
use sevenbot::{Arm, Problem, Span};

use self::outputs::{RecordingOutputs, is_stdout};
use self::teach_pendant::TeachPendant;
use self::telemetry::TelemetryReader;
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::interrupt::{Interrupt, hold, report_hold};
use crate::printer::{Printable, note};
use crate::session::Session;

/// Record a movement: guide the arm by hand, or let it move.
///
/// The motors go off so that you can guide the arm, and its positions go to FILE. Ctrl-C ends the recording, and the
/// arm holds its pose, also with --driven. On a terminal v switches the vacuum pump, and the space bar ends
/// the recording as Ctrl-C does.
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("outputs").args(["file", "mcap"]).required(true).multiple(true)))]
#[command(after_help = "\
Examples:
  sevenbot record wave.txt  hold the arm, answer y, guide it; Ctrl-C ends
  sevenbot record wave.txt --driven
                            the motors stay on, the arrow keys move the arm
  sevenbot pose 150 60 90 90 90 90 80 --speed 10
  sevenbot record move.txt --driven --seconds 5
                            records a move
  sevenbot record --mcap move.mcap --driven
                            for Rerun and ROS 2, with velocities and loads
  sevenbot record --mcap - --driven | program
                            each moment at once, for a program that reads MCAP

FILE is text, one line per moment: seconds, seven angles in degrees, vacuum.
Angles have two decimals if the arm measures them. `sevenbot play` plays it, and
also a file written by hand. `sevenbot convert` makes it CSV or MCAP.

An MCAP file has messages of ROS 2, in radians: /joint_states, /tf and
/robot_description, with --driven the targets as /robot_joint_command,
/diagnostics once a second, and /vacuum. Velocities and loads are read up to
20 ms after the positions. If the program is killed, the last second is missing.

Exit status 1 if a servo does not answer, because the joint's position is
unknown then, or if the controller restarts. The file has what was recorded
before. Also 1 if it ends before the first moment: then no file has changed.")]
pub(crate) struct RecordArgs {
    /// The text file for the recording.
    file: Option<PathBuf>,
    /// Write an MCAP file, beside FILE or without it; - is standard output.
    #[arg(long, value_name = "MCAP")]
    mcap: Option<PathBuf>,
    /// End after N seconds.
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=86_400))]
    seconds: Option<u32>,
    /// Moments per second.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = value_parser!(u8).range(1..=50))]
    hz: u8,
    /// Leave the motors on, to record a move of the arm or one made with keys.
    #[arg(long)]
    driven: bool,
    /// Do not ask whether the arm is held and the files may be replaced.
    #[arg(long)]
    yes: bool,
}

/// The longest wait for a report. Then keys and Ctrl-C are checked again.
const POLL_PERIOD: Duration = Duration::from_millis(20);

#[derive(Debug, Serialize)]
struct RecordSummary {
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mcap: Option<String>,
    moments: u64,
    seconds: f64,
}

impl RecordSummary {
    fn of(args: &RecordArgs, outputs: &RecordingOutputs) -> Self {
        let name = |path: &Option<PathBuf>| match path {
            Some(path) if is_stdout(path) => Some("standard output".to_owned()),
            path => path.as_ref().map(|path| path.display().to_string()),
        };
        let (moments, seconds) = (outputs.count(), outputs.duration().as_secs_f64());
        Self { file: name(&args.file), mcap: name(&args.mcap), moments, seconds }
    }
}

impl fmt::Display for RecordSummary {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let files: Vec<&str> = self.file.iter().chain(&self.mcap).map(String::as_str).collect();
        write!(out, "{}: {} moments in {:.1} s", files.join(", "), self.moments, self.seconds)
    }
}

impl Printable for RecordSummary {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{self}")
    }
}

pub(crate) fn run(session: &mut Session, args: &RecordArgs) -> Result<(), CommandError> {
    check_names(args)?;
    let mut arm = session.connect_to_move()?;
    for path in args.file.iter().chain(&args.mcap).filter(|path| path.is_file()) {
        confirm(&format!("{} exists. Replace it?", path.display()), args.yes)?;
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
    let mut outputs = RecordingOutputs::open(args.file.as_deref(), args.mcap.as_deref(), version)?;
    Interrupt::catch();
    let before = arm.joints()?;
    let baud = session.options.baud;
    let done = set_motors(&mut arm, args).and_then(|()| {
        arm.with_reports(args.hz, content, |arm| {
            // After a restart the controller drives the joints, although the user is to guide them.
            if arm.joints()?.has_restarted_since(&before) {
                return Err(CommandError::Problems(vec![Problem::of_arm(ProblemKind::Restarted)]));
            }
            record_reports(arm, args, (content, baud), &mut outputs)
        })
    });
    // Without a connection the arm cannot be made to hold.
    let is_gone = done.as_ref().is_err_and(CommandError::is_connection_lost);
    let held = if is_gone && !Interrupt::is_requested() { Ok(()) } else { hold_at_end(&mut arm, args) };
    let done = done.and(outputs.finish());
    if done.is_err() {
        outputs.note_what_is_there();
    }
    done.and(held)?;
    let recorded = RecordSummary::of(args, &outputs);
    if args.mcap.as_deref().is_some_and(is_stdout) {
        note(recorded);
        return Ok(());
    }
    session.printer.print(&recorded)
}

/// Refuses a FILE whose name means standard output, MCAP or CSV: FILE is always text.
fn check_names(args: &RecordArgs) -> Result<(), CommandError> {
    let Some(file) = &args.file else { return Ok(()) };
    let name = file.display();
    let reason = match Format::of_name(file) {
        _ if is_stdout(file) => {
            "- is no name of a file: to record to standard output, use /dev/stdout".to_owned()
        }
        Some(Format::Mcap) => format!("FILE is text: for MCAP use --mcap {name}"),
        Some(Format::Csv) => format!("FILE is text: `sevenbot convert` makes {name} of it"),
        _ => return Ok(()),
    };
    Err(CommandError::Usage(reason))
}

/// Switches the motors off if the user guides the arm; with --driven, writes motor state 1 (servo).
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

/// Records reports until a key, Ctrl-C or `--seconds` ends the recording.
fn record_reports(
    arm: &mut Arm,
    args: &RecordArgs,
    (content, baud): (u8, u32),
    outputs: &mut RecordingOutputs,
) -> Result<(), CommandError> {
    let vacuum = arm.read_span(Span::of(&VACUUM_PUMP))?.byte(&VACUUM_PUMP) != 0;
    let mut pendant = TeachPendant::new(arm.targets()?, vacuum, args.driven);
    let mut recorder = Recorder::begin(arm, args.hz, content)?;
    let mut telemetry = args.mcap.is_some().then(|| {
        let (reports, is_fine) =
            (arm.report_period(args.hz, content), content == report_content::FINE_POSITIONS);
        TelemetryReader::new(arm, baud, reports, args.driven, is_fine)
    });
    let limit = args.seconds.map(|seconds| Duration::from_secs(seconds.into()));
    while !Interrupt::is_requested() && !pendant.poll_keys(arm)? {
        let Some(RecordedPose { time, pose, .. }) = recorder.next(arm, POLL_PERIOD)? else { continue };
        if limit.is_some_and(|limit| time > limit) {
            break;
        }
        let told = telemetry.as_mut().map_or(Ok(Telemetry::default()), |reader| reader.read(arm))?;
        outputs.add(&Moment { time, pose, vacuum: pendant.vacuum() }, &told)?;
        if let Some(health) = telemetry.as_mut().map_or(Ok(None), |reader| reader.health(arm))? {
            outputs.diagnose(time, &health, arm.port())?;
        }
        pendant.show(outputs.count(), time);
    }
    Ok(())
}
