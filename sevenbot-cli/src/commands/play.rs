//! `play`: moves the arm along a recording, and plots the result.
//!
//! ```text
//!   file ──▶ check ──▶ slow approach to the first pose ──▶ one frame per step ──▶ last pose
//!                                                          or a stream     └── reports ──▶ plot
//! ```
//!
//! An arm with the extended block gets a stream of points in hundredths of a degree, another one whole degrees with speeds.

use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::{Args, value_parser};
use serde::Serialize;
use sevenbot::map::{SPEED, TIME, VACUUM_PUMP};
use sevenbot::playback::{self, Step};
use sevenbot::point_path::PointPath;
use sevenbot::recording::{Moment, Recording};
use sevenbot::{Arm, FineAngle, Snapshot, Span};

mod stream;

use crate::command_error::CommandError;
use crate::interrupt::{Interrupt, hold_on_interrupt};
use crate::joint_move::{JointMove, driven_joints};
use crate::plot::{self, Track};
use crate::printer::Printable;
use crate::progress::Progress;
use crate::reports::{exact_positions, reports_stopped, with_reports};
use crate::session::Session;
use crate::write_result::all_taken;

/// Play a recorded movement.
///
/// The whole file is checked before the arm moves. The arm moves slowly to the first pose. Ctrl-C makes it hold its
/// position.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot play wave.txt
  sevenbot play wave.txt --speed 0.5 --loop=3
  sevenbot play wave.txt --plot wave.svg       plots targets and measured positions

An arm with this project's firmware gets a point in hundredths of a degree each 20 ms, and its watchdog makes it
hold if this program dies. Others get whole degrees and speeds each 50 ms.")]
pub(crate) struct PlayArgs {
    /// A recording of `sevenbot record`, or one written by hand.
    file: PathBuf,
    /// Speed factor, 0.1 to 10.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor)]
    speed: f64,
    /// Repeat without end, or N times in all.
    #[arg(long = "loop", value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "0",
          value_parser = value_parser!(u32))]
    times: Option<u32>,
    /// Write an SVG plot of the targets and the measured positions of the first run.
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
}

/// Frequency of the reports while playing, in Hz.
const FEEDBACK_HZ: u8 = 30;
/// Without a report for this time, the arm has stopped reporting.
const REPORT_TIMEOUT: Duration = Duration::from_secs(2);
/// The longest reaction time to Ctrl-C.
const POLL_PERIOD: Duration = Duration::from_millis(20);
/// The plot continues for this time after the end, because servos lag.
const PLOT_TAIL: Duration = Duration::from_millis(300);

/// The result of `play`.
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
    let mut arm = session.connect()?;
    driven_joints(&mut arm)?;
    let mut player = Player::new(&recording, args.speed);
    let done = player.play_and_restore(&mut arm, args.times.unwrap_or(1));
    if let Some(path) = &args.plot {
        fs::write(path, player.plot(args)).map_err(|error| CommandError::file(path, error))?;
    }
    done?;
    let Player { played, seconds, .. } = player;
    session.printer.print(&Played { times: played, seconds })
}

/// Makes an arm follow a planned movement once. Restores the speeds and times that it had before.
pub(super) fn follow(arm: &mut Arm, recording: &Recording) -> Result<(), CommandError> {
    driven_joints(arm)?;
    Player::new(recording, 1.0).play_and_restore(arm, 1)
}

/// Reads the recording, and checks that an arm can follow it.
fn load(args: &PlayArgs) -> Result<Recording, CommandError> {
    let text = fs::read_to_string(&args.file).map_err(|error| CommandError::file(&args.file, error))?;
    let recording = Recording::parse(&text);
    let checked = recording.and_then(|recording| recording.check_speeds(args.speed).map(|()| recording));
    checked.map_err(|error| CommandError::file(&args.file, error))
}

fn factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor| (0.1..=10.0).contains(factor));
    factor.ok_or_else(|| "a number from 0.1 to 10".to_owned())
}

/// Restores the speeds and durations from before.
fn restore_pace(arm: &mut Arm, before: &Snapshot) -> Result<(), CommandError> {
    all_taken(&arm.write_checked(before.address, &before.values)?)
}

/// Plays a recording, and keeps the measured positions.
struct Player {
    moments: Vec<Moment>,
    steps: Vec<Step>,
    path: PointPath,
    /// Positions during the first run, and their times since its start.
    measured: Vec<(Duration, [FineAngle; 7])>,
    /// When the last report arrived.
    last_report: Instant,
    played: u32,
    seconds: f64,
}

impl Player {
    fn new(recording: &Recording, factor: f64) -> Self {
        let seconds = recording.duration().as_secs_f64() / factor;
        let (moments, steps) = (recording.moments().collect(), playback::steps(recording, factor));
        let path = PointPath::new(recording, factor);
        Self { moments, steps, path, measured: Vec::new(), last_report: Instant::now(), played: 0, seconds }
    }

    /// Plays this many times, and restores the speeds and times that the arm had before.
    fn play_and_restore(&mut self, arm: &mut Arm, times: u32) -> Result<(), CommandError> {
        let before = arm.read_span(Span::between(&SPEED, &TIME))?;
        let content = exact_positions(arm)?;
        let done = with_reports(arm, FEEDBACK_HZ, content, |arm| {
            hold_on_interrupt(arm, |arm, interrupt| self.play(arm, interrupt, times))
        });
        // Without a connection the speeds cannot be restored.
        let is_gone = done.as_ref().is_err_and(CommandError::is_connection_lost);
        let restored = if is_gone { Ok(()) } else { restore_pace(arm, &before) };
        done.and(restored)
    }

    /// Plays the recording this many times; 0 means until interrupted.
    fn play(&mut self, arm: &mut Arm, interrupt: Interrupt, times: u32) -> Result<(), CommandError> {
        while times == 0 || self.played < times {
            self.approach(arm, interrupt)?;
            self.play_once(arm, interrupt)?;
            self.played = self.played.saturating_add(1);
        }
        Ok(())
    }

    /// Moves slowly to the first pose.
    fn approach(&self, arm: &mut Arm, interrupt: Interrupt) -> Result<(), CommandError> {
        let Some(first) = self.moments.first() else { return Ok(()) };
        let step = playback::approach(arm.positions()?, *first);
        let pace = step.registers();
        let pace = pace.get(..pace.len().saturating_sub(step.targets.len())).unwrap_or_default();
        all_taken(&arm.write_checked(VACUUM_PUMP.address, pace)?)?;
        move_to(arm, interrupt, first.pose)
    }

    /// Plays the whole recording once.
    fn play_once(&mut self, arm: &mut Arm, interrupt: Interrupt) -> Result<(), CommandError> {
        if arm.has_extended_block()? {
            self.stream(arm, interrupt)?;
        } else {
            let steps = std::mem::take(&mut self.steps);
            let done = self.send(&steps, arm, interrupt);
            self.steps = steps;
            done?;
        }
        let end = self.moments.last().map(|last| last.pose);
        end.map_or(Ok(()), |pose| move_to(arm, interrupt, pose))
    }

    fn send(&mut self, steps: &[Step], arm: &mut Arm, interrupt: Interrupt) -> Result<(), CommandError> {
        let progress = Progress::new(u64::try_from(steps.len()).unwrap_or(u64::MAX), "steps");
        arm.reports().for_each(drop);
        let start = Instant::now();
        self.last_report = start;
        for (number, step) in (1..).zip(steps) {
            self.take_reports_until(start, step.time, arm, interrupt)?;
            arm.write(VACUUM_PUMP.address, &step.registers())?;
            progress.set(number);
        }
        let end = steps.last().map_or(Duration::ZERO, |step| step.time);
        self.take_reports_until(start, end + PLOT_TAIL, arm, interrupt)
    }

    /// Takes reports until `time` after `start`.
    fn take_reports_until(
        &mut self,
        start: Instant,
        time: Duration,
        arm: &mut Arm,
        interrupt: Interrupt,
    ) -> Result<(), CommandError> {
        loop {
            interrupt.check()?;
            let left = time.saturating_sub(start.elapsed());
            if left.is_zero() {
                return Ok(());
            }
            match arm.next_report(left.min(POLL_PERIOD))? {
                Some(report) => {
                    self.last_report = report.received;
                    if self.played == 0 {
                        self.measured.push((report.received.saturating_duration_since(start), report.pose()));
                    }
                }
                None if self.last_report.elapsed() > REPORT_TIMEOUT => return Err(silent(arm)),
                None => {}
            }
        }
    }

    fn plot(&self, args: &PlayArgs) -> String {
        let mut tracks: [Track; 7] = Default::default();
        let start = self.moments.first().map_or(Duration::ZERO, |moment| moment.time);
        for moment in &self.moments {
            let seconds = (moment.time.saturating_sub(start)).as_secs_f64() / args.speed;
            for (track, angle) in tracks.iter_mut().zip(moment.pose) {
                track.target.push((seconds, angle.degrees()));
            }
        }
        for (time, pose) in &self.measured {
            for (track, angle) in tracks.iter_mut().zip(pose) {
                track.measured.push((time.as_secs_f64(), angle.degrees()));
            }
        }
        let name = args.file.file_name().unwrap_or_default().to_string_lossy();
        let speed = if args.speed == 1.0 { String::new() } else { format!(", speed {}", args.speed) };
        plot::svg(&format!("{name}{speed}"), &tracks)
    }
}

fn move_to(arm: &mut Arm, interrupt: Interrupt, pose: [FineAngle; 7]) -> Result<(), CommandError> {
    let there = JointMove::begin_fine(arm, pose.map(Some))?;
    there.finish(arm, interrupt).map(drop)
}

/// Why reports are missing.
fn silent(arm: &mut Arm) -> CommandError {
    match driven_joints(arm) {
        Err(failure) => failure,
        Ok(_) => reports_stopped(),
    }
}
