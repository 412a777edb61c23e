//! `record`: what a hand shows the arm, or what the arm does, to a file.
//!
//! ```text
//!   arm ── reports, sent unasked ──▶ ReportClock (when each was measured) ──▶ one line each ──▶ file
//!                                     TeachPendant (keys: pump, nudges, end) ──┘
//! ```
//!
//! However it ends, the file is whole up to there, and an arm that is still there holds where it is.

mod report_clock;
mod teach_pendant;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::{Args, value_parser};
use serde::Serialize;
use sevenbot::map::{FEEDBACK_FREQUENCY, MOTOR_STATE, VACUUM_PUMP, motor_state};
use sevenbot::recording::{self, Moment};
use sevenbot::{Arm, Span};

use self::report_clock::ReportClock;
use self::teach_pendant::TeachPendant;
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::interrupt::{Interrupt, hold, report_hold};
use crate::joint_move::driven_joints;
use crate::line_file::LineFile;
use crate::printer::{Printable, note};
use crate::reports::with_reports;
use crate::session::Session;
use crate::write_result::motors_obey;

/// Record a movement: guide the arm by hand, or watch it move.
///
/// The arm goes limp, so that a hand can lead it, and its positions go to a file as they come. Ctrl-C ends it:
/// the arm then holds the pose that it was left in,
/// with --driven too. On a terminal the space bar switches the vacuum pump.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot record wave.txt                     hold the arm, answer y, lead it; Ctrl-C ends
  sevenbot record wave.txt --driven            the motors stay on, the arrow keys move the arm
  sevenbot pose 150 60 90 90 90 90 80 --speed 10
  sevenbot record move.txt --driven --seconds 5    a move that is under way

The file is text, a line a moment: seconds, seven angles in degrees, vacuum. `sevenbot play` moves the arm
by it, and so it does by a file that was written by hand.")]
pub(crate) struct RecordArgs {
    /// Where the recording goes.
    file: PathBuf,
    /// End after so many seconds.
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=86_400))]
    seconds: Option<u32>,
    /// Moments a second.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = value_parser!(u8).range(1..=50))]
    hz: u8,
    /// Leave the motors on: record a move that is under way, or one made by keys.
    #[arg(long)]
    driven: bool,
    /// The arm is held, and FILE may be replaced: do not ask.
    #[arg(long)]
    yes: bool,
}

/// No report for so long, and something is wrong. The slowest rate is one a second.
const REPORT_TIMEOUT: Duration = Duration::from_secs(3);
/// How long a key, or Ctrl-C, may wait.
const POLL_PERIOD: Duration = Duration::from_millis(20);

/// What was recorded.
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
    let mut arm = session.connect()?;
    let replaced = args.file.exists();
    if replaced {
        confirm(&format!("{} is there already. Replace it?", args.file.display()), args.yes)?;
    }
    if args.driven {
        driven_joints(&mut arm)?;
    } else {
        confirm("The arm goes limp, and falls unless somebody holds it. Go on?", args.yes)?;
    }
    let mut recording = RecordingFile::create(&args.file)?;
    Interrupt::catch();
    let baud = session.options.baud;
    let done = set_motors(&mut arm, args).and_then(|()| {
        with_reports(&mut arm, args.hz, |arm| record_reports(arm, args, baud, &mut recording))
    });
    // An arm that went away cannot be told to hold; it was left as it is.
    let is_gone = done.as_ref().is_err_and(CommandError::is_connection_lost);
    let held = if is_gone && !Interrupt::is_requested() { Ok(()) } else { hold_at_end(&mut arm, args) };
    let RecordingFile { moments, seconds, .. } = recording;
    let recorded = Recorded { file: args.file.display().to_string(), moments, seconds };
    if done.is_err() {
        note(format_args!("{} is complete up to {seconds:.1} s, {moments} moments", recorded.file));
    }
    done.and(held)?;
    session.printer.print(&recorded)
}

/// Lets the arm go, if a hand is to lead it.
fn set_motors(arm: &mut Arm, args: &RecordArgs) -> Result<(), CommandError> {
    let state = if args.driven { motor_state::SERVO } else { motor_state::FORCELESS };
    motors_obey(arm.write_checked(MOTOR_STATE.address, &[state]))
}

/// Makes the arm hold the pose it was left in. A driven arm goes on with its move, but not after Ctrl-C.
fn hold_at_end(arm: &mut Arm, args: &RecordArgs) -> Result<(), CommandError> {
    if args.driven {
        if Interrupt::is_requested() {
            report_hold(&hold(arm)?);
        }
        return Ok(());
    }
    // Coming from forceless, the targets become what was measured (D13).
    motors_obey(arm.write_checked(MOTOR_STATE.address, &[motor_state::SERVO]))?;
    note("the arm holds where it is");
    Ok(())
}

/// Takes reports until it is enough.
fn record_reports(
    arm: &mut Arm,
    args: &RecordArgs,
    baud: u32,
    recording: &mut RecordingFile,
) -> Result<(), CommandError> {
    let vacuum = arm.read_span(Span::of(&VACUUM_PUMP))?.byte(&VACUUM_PUMP) != 0;
    let mut pendant = TeachPendant::new(arm.targets()?, vacuum, args.driven);
    let mut clock = ReportClock::new(args.hz, baud);
    let limit = args.seconds.map(|seconds| Duration::from_secs(seconds.into()));
    let mut last_report = Instant::now();
    while !Interrupt::is_requested() && !pendant.poll_keys(arm)? {
        if let Some(report) = arm.next_report(POLL_PERIOD)? {
            last_report = report.received;
            let time = clock.time_of(report.received);
            if limit.is_some_and(|limit| time > limit) {
                break;
            }
            recording.add(&Moment { time, pose: report.positions, vacuum: pendant.vacuum() })?;
            pendant.show(recording.moments, time);
        } else if last_report.elapsed() > REPORT_TIMEOUT {
            return Err(silent(arm));
        }
    }
    Ok(())
}

/// Why no report comes any more.
fn silent(arm: &mut Arm) -> CommandError {
    match arm.read_span(Span::of(&FEEDBACK_FREQUENCY)) {
        Err(error) => error.into(),
        Ok(_) => CommandError::Arm(
            "the arm has stopped to report its positions: was it switched off and on again?".to_owned(),
        ),
    }
}

/// The file, and how much is in it.
struct RecordingFile {
    file: LineFile,
    moments: u64,
    seconds: f64,
}

impl RecordingFile {
    fn create(path: &Path) -> Result<Self, CommandError> {
        let mut file = LineFile::create(path)?;
        file.add(&recording::head())?;
        Ok(Self { file, moments: 0, seconds: 0.0 })
    }

    fn add(&mut self, moment: &Moment) -> Result<(), CommandError> {
        self.file.add(&format!("{moment}\n"))?;
        self.moments += 1;
        self.seconds = moment.time.as_secs_f64();
        Ok(())
    }
}
