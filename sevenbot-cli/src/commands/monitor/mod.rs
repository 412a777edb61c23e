//! `monitor`: shows the arm live on a terminal's screen, or as lines in a pipe or file.
//!
//! ```text
//!              ┌─ screen: draws, takes keys ──┐
//!   terminal ──┤     │ commands    ▲ events   ├── View ── draw
//!              └─ arm_thread: owns the arm ───┘
//!   otherwise ── lines: columns, CSV, JSON
//! ```

mod arm_thread;
mod draw;
mod draw_dialog;
mod keys;
mod lines;
mod plot_kind;
pub(super) mod sample;
mod screen;
mod view;

use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

use clap::{Args, value_parser};
use sevenbot::{Arm, Health, Problem};

use self::lines::{LineFormat, SampleJson};
use self::plot_kind::PlotKind;
use self::sample::ArmSample;
use crate::command_error::CommandError;
use crate::guard_args::GuardArgs;
use crate::interrupt::Interrupt;
use crate::line_file::LineFile;
use crate::output_file::{ForceArg, OutputFile};
use crate::printer::warn;
use crate::session::Session;

/// Watch the arm: targets, positions, movement, health and link quality.
///
/// On a terminal it fills the screen; ? lists the keys, which can also move the arm. If the arm is lost the monitor
/// reconnects. In a pipe or file it prints one line per sample, and a lost arm is an error.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot monitor
  sevenbot monitor --plot load
  sevenbot monitor --csv move.csv  until Ctrl-C, or the arm goes away
  sevenbot monitor --json --hz 2 | jq .positions
  sevenbot monitor --hz 20 --samples 100 > move.txt

The keys that move the tip keep it above the table and out of the base;
`sevenbot move-to --help` describes this guard. A key that turns a joint
only warns.

CSV and JSON also have positions in hundredths of a degree, velocities in
degrees per second and loads in percent of the stall torque, if the arm
measures them.")]
pub(crate) struct MonitorArgs {
    /// Samples per second.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = value_parser!(u8).range(1..=50))]
    hz: u8,
    /// End after N samples. Prints lines, even on a terminal.
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..=1_000_000_000))]
    samples: Option<u64>,
    /// Write all values to FILE, separated by commas.
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    force: ForceArg,
    /// What the plot on the screen shows at first; p changes it.
    #[arg(long, value_enum, default_value_t)]
    plot: PlotKind,
    #[command(flatten)]
    guard: GuardArgs,
}

impl MonitorArgs {
    fn period(&self) -> Duration {
        period(self.hz)
    }
}

pub(crate) fn run(session: &mut Session, args: &MonitorArgs) -> Result<(), CommandError> {
    let on_screen = session.printer.is_terminal() && args.csv.is_none() && args.samples.is_none();
    if on_screen && session.log.is_some() {
        let reason =
            "--log: a screen opens the arm again after each loss; use --samples N, --csv or a pipe for a log";
        return Err(CommandError::Usage(reason.to_owned()));
    }
    match &args.csv {
        Some(path) => write_csv(session, args, path),
        None if on_screen => screen::run(session, args.period(), args.plot, args.guard.guard()),
        None => show_lines(session, args),
    }
}

pub(super) fn period(hz: u8) -> Duration {
    Duration::from_secs(1) / u32::from(hz)
}

/// Takes `count` samples, one per period, passes each to `take`, and warns of new problems. Ctrl-C ends it.
pub(super) fn each_sample(
    arm: &mut Arm,
    period: Duration,
    count: u64,
    mut take: impl FnMut(ArmSample) -> Result<(), CommandError>,
) -> Result<(), CommandError> {
    Interrupt::catch();
    let start = Instant::now();
    let (mut due, mut told) = (start, Vec::new());
    for _ in 0..count {
        sleep(due.saturating_duration_since(Instant::now()));
        // If a sample is more than a period late, the next one is due now: missed samples are not made up for.
        due = (due + period).max(Instant::now());
        let sample = ArmSample::take(arm, start);
        if Interrupt::is_requested() {
            return Ok(());
        }
        let sample = sample?;
        warn_of_problems(&sample.health, &mut told);
        take(sample)?;
    }
    Ok(())
}

/// Warns of the problems that the previous sample did not have: the columns have no field for them.
fn warn_of_problems(health: &Health, told: &mut Vec<Problem>) {
    let problems = health.problems();
    problems.iter().filter(|problem| !told.contains(problem)).for_each(warn);
    *told = problems;
}

fn show_lines(session: &mut Session, args: &MonitorArgs) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    let printer = &mut session.printer;
    if !printer.is_json() {
        printer.print_raw(format!("{}\n", LineFormat::Columns.head()).as_bytes())?;
    }
    each_sample(&mut arm, args.period(), args.samples.unwrap_or(u64::MAX), |sample| {
        if printer.is_json() {
            printer.print(&SampleJson::from(&sample))
        } else {
            printer.print_raw(format!("{}\n", LineFormat::Columns.line(&sample)).as_bytes())
        }
    })
}

fn write_csv(session: &Session, args: &MonitorArgs, path: &Path) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    let mut file = LineFile::begin(OutputFile::open(path, None, args.force)?)?;
    let mut write = |line: String| file.add(&format!("{line}\n"));
    write(LineFormat::Csv.head())?;
    each_sample(&mut arm, args.period(), args.samples.unwrap_or(u64::MAX), |sample| {
        write(LineFormat::Csv.line(&sample))
    })
}
