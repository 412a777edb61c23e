//! `monitor`: the arm as it moves; a table redrawn in place on a terminal, one line a sample anywhere else.
//!
//! Only reads, so it can be ended at any moment.

use std::io::{self, IsTerminal, Write};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anstyle::{AnsiColor, Style};
use sevenbot::arm::STATUS;
use sevenbot::map::{
    FAULTS, MISSING_SERVOS, MOVING_JOINTS, PRESENT_POSITION, SERVO_TEMPERATURE, SUPPLY_VOLTAGE,
    TARGET_POSITION,
};
use sevenbot::words::{faults, meaning};
use sevenbot::{Arm, Error, Joint, Snapshot, Span};

use clap::{Args, value_parser};

use crate::failure::Failure;
use crate::session::Session;

const BOLD: Style = Style::new().bold();
const MOVING: Style = AnsiColor::Cyan.on_default();
const BAD: Style = AnsiColor::Red.on_default().bold();
/// Clears to the end of the line, so that a shorter one leaves nothing of a longer one.
const CLEAR: &str = "\x1b[K";
/// Lines of the table: a head, seven joints, a foot.
const LINES: usize = 9;

/// Watch targets, positions and movement; Ctrl-C ends it.
#[derive(Debug, Args)]
#[command(after_help = "\
On a terminal the table is redrawn in place; into a pipe or a file goes one line a sample.

Examples:
  sevenbot monitor
  sevenbot monitor --hz 20 --samples 100 > move.txt")]
pub(crate) struct MonitorArgs {
    /// Samples a second.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = value_parser!(u8).range(1..=50))]
    pub(crate) hz: u8,
    /// End after so many samples.
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..))]
    pub(crate) samples: Option<u64>,
}

/// The arm at one moment.
struct Sample {
    positions: Snapshot,
    status: Snapshot,
}

impl Sample {
    fn take(arm: &mut Arm) -> Result<Self, Error> {
        let positions = arm.read_span(Span::between(&TARGET_POSITION, &PRESENT_POSITION))?;
        Ok(Self { positions, status: arm.read_span(STATUS)? })
    }

    fn target(&self, joint: Joint) -> u8 {
        self.positions.at(TARGET_POSITION.of(joint))
    }

    fn present(&self, joint: Joint) -> u8 {
        self.positions.at(PRESENT_POSITION.of(joint))
    }

    fn is_moving(&self, joint: Joint) -> bool {
        self.status.byte(&MOVING_JOINTS) & joint.bit() != 0
    }

    fn is_missing(&self, joint: Joint) -> bool {
        self.status.byte(&MISSING_SERVOS) & joint.bit() != 0
    }
}

pub(crate) fn run(session: &mut Session, args: &MonitorArgs) -> Result<(), Failure> {
    watch(&mut session.connect()?, args, &mut anstream::stdout())
}

fn watch(arm: &mut Arm, args: &MonitorArgs, out: &mut impl Write) -> Result<(), Failure> {
    let period = Duration::from_secs(1) / u32::from(args.hz);
    let in_place = io::stdout().is_terminal();
    let start = Instant::now();
    let mut due = start;
    let mut shown = 0;
    while args.samples.is_none_or(|samples| shown < samples) {
        sleep(due.saturating_duration_since(Instant::now()));
        // A sample that could not be taken in time is left out, not made up for.
        due = (due + period).max(Instant::now());
        let sample = Sample::take(arm)?;
        if in_place {
            redraw(&sample, shown > 0, out)?;
        } else {
            add_line(&sample, start.elapsed(), shown == 0, out)?;
        }
        out.flush()?;
        shown += 1;
    }
    Ok(())
}

fn redraw(sample: &Sample, again: bool, out: &mut impl Write) -> io::Result<()> {
    if again {
        write!(out, "\x1b[{LINES}A")?;
    }
    writeln!(out, "{BOLD}joint  target  present{BOLD:#}{CLEAR}")?;
    for joint in Joint::ALL {
        let (number, target, present) = (joint.number(), sample.target(joint), sample.present(joint));
        let (style, word) = match (sample.is_missing(joint), sample.is_moving(joint)) {
            (true, _) => (BAD, "no answer"),
            (false, true) => (MOVING, "moving"),
            (false, false) => (Style::new(), ""),
        };
        writeln!(out, "{number:>5}  {target:>5}°  {present:>6}°  {style}{word}{style:#}{CLEAR}")?;
    }
    writeln!(out, "{}{CLEAR}", foot(&sample.status))
}

fn foot(status: &Snapshot) -> String {
    let supply = meaning(&SUPPLY_VOLTAGE, status.byte(&SUPPLY_VOLTAGE));
    let temperature = status.byte(&SERVO_TEMPERATURE);
    let faults = faults(status.byte(&FAULTS));
    format!("supply {supply}, hottest servo {temperature} °C, faults: {faults}")
}

/// Seconds, seven targets, seven positions, and which joints move: columns that a script can split.
fn add_line(sample: &Sample, time: Duration, first: bool, out: &mut impl Write) -> io::Result<()> {
    if first {
        let columns = |word: &str| Joint::ALL.map(|joint| format!("{word}.{}", joint.number())).join(" ");
        writeln!(out, "seconds {} {} moving", columns("target"), columns("present"))?;
    }
    let targets = Joint::ALL.map(|joint| sample.target(joint).to_string()).join(" ");
    let present = Joint::ALL.map(|joint| sample.present(joint).to_string()).join(" ");
    let moving = Joint::ALL.iter().filter(|&&joint| sample.is_moving(joint));
    let moving: String = moving.map(|joint| joint.number().to_string()).collect();
    let moving = if moving.is_empty() { "-" } else { &moving };
    writeln!(out, "{:.3} {targets} {present} {moving}", time.as_secs_f64())
}
