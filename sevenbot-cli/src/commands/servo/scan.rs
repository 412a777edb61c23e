//! `servo scan`: finds the servos on the bus, and their baud rates.

use std::io::{self, Write};
use std::ops::RangeInclusive;
use std::time::Duration;

use clap::{Args, value_parser};
use serde::Serialize;
use sevenbot::Joint;
use sevenbot::servo_bench::scan::{AnswerQuality, FoundServo, ScanPlan, ScanResult, scan};
use sevenbot::servo_bench::{BAUD_RATES, MAX_ID};

use super::port::{leads_to_arm, open, port, rate};
use crate::command_error::CommandError;
use crate::printer::{Printable, warn};
use crate::progress::Progress;
use crate::session::Session;
use crate::style::WARNING;

/// Find the servos on the bus, at all eight baud rates.
///
/// Only reads: no servo moves.
#[derive(Debug, Args)]
#[command(after_help = "\
The first pass asks each id with a short timeout, the second each found id with
the full one. All 254 ids take about 1.4 s at 1000000 baud and 17 s at all eight
rates. \"several servos\" or \"damaged answers\" usually means that two servos
have the same id.

Exit status 1 when an id does not answer as one servo does, 3 when no
servo answers.

Examples:
  sevenbot servo scan
  sevenbot servo scan --rates 1000000 --ids 0-6
        the servos of an arm, as its controller asks them
  sevenbot servo scan --json")]
pub(super) struct ScanArgs {
    /// Try only these baud rates.
    #[arg(long, value_name = "RATE,..", value_delimiter = ',', value_parser = rate)]
    rates: Vec<u32>,
    /// Ask only these ids, such as 5 or 0-6.
    #[arg(long, value_name = "ID-ID", default_value = "0-253", value_parser = ids)]
    ids: RangeInclusive<u8>,
    /// Timeout for each id in milliseconds, instead of the time that a servo needs.
    #[arg(long, value_name = "MS", value_parser = value_parser!(u16).range(1..))]
    wait: Option<u16>,
}

fn ids(text: &str) -> Result<RangeInclusive<u8>, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let id = |text: &str| text.trim().parse().ok().filter(|&id: &u8| id <= MAX_ID);
    match (id(first), id(last)) {
        (Some(first), Some(last)) if first <= last => Ok(first..=last),
        _ => Err(format!("use one id or two with a hyphen, from 0 to {MAX_ID}")),
    }
}

#[derive(Serialize)]
struct FoundServos {
    port: String,
    /// Does the adapter echo sent bytes?
    echo: bool,
    servos: Vec<ServoRow>,
    rates_not_tried: Vec<u32>,
}

#[derive(Serialize)]
struct ServoRow {
    id: u8,
    baud: u32,
    /// None if no joint of the arm has this id.
    joint: Option<u8>,
    answers: &'static str,
}

impl From<&FoundServo> for ServoRow {
    fn from(found: &FoundServo) -> Self {
        let joint = Joint::from_index(found.id).map(Joint::number);
        Self { id: found.id, baud: found.baud, joint, answers: found.answers.name() }
    }
}

impl Printable for FoundServos {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        for ServoRow { id, baud, joint, answers } in &self.servos {
            let joint = joint.map_or_else(|| "no joint's id".to_owned(), |joint| format!("joint {joint}"));
            write!(out, "id {id:<3}  {baud:>7} baud  ")?;
            if *answers == AnswerQuality::Good.name() {
                writeln!(out, "{joint}")?;
            } else {
                writeln!(out, "{joint:<13}  {WARNING}{answers}{WARNING:#}")?;
            }
        }
        writeln!(
            out,
            "{}",
            if self.echo { "the adapter echoes what is sent" } else { "the adapter gives no echo" }
        )
    }
}

pub(super) fn run(session: &mut Session, args: &ScanArgs) -> Result<(), CommandError> {
    let port = port(session)?;
    let rates = if args.rates.is_empty() { BAUD_RATES.to_vec() } else { args.rates.clone() };
    let wait = args.wait.map(|millis| Duration::from_millis(millis.into()));
    let plan = ScanPlan { ids: args.ids.clone(), wait, rates };
    let mut bus = open(session, plan.rates.first().copied().unwrap_or(1_000_000))?;
    let scan = with_progress(&plan, |tell| scan(&mut bus, &plan, tell));
    let ScanResult { found, unknown_rates, has_echo } =
        scan.map_err(|error| CommandError::Servo { port: port.clone(), error })?;
    for rate in &unknown_rates {
        warn(format_args!("this adapter does not support {rate} baud: that rate was not scanned"));
    }
    if found.is_empty() {
        let is_host_link = leads_to_arm(session, bus, &port);
        return Err(if is_host_link {
            CommandError::HostLink { port }
        } else {
            CommandError::NoServo { port, has_echo }
        });
    }
    let servos = found.iter().map(ServoRow::from).collect();
    session.printer.print(&FoundServos { port, echo: has_echo, servos, rates_not_tried: unknown_rates })?;
    all_good(&found)
}

/// Runs a scan with a progress bar.
pub(super) fn with_progress<T>(
    plan: &ScanPlan,
    scan: impl FnOnce(&mut dyn FnMut(sevenbot::servo_bench::scan::ScanProgress)) -> T,
) -> T {
    let total = u64::try_from(plan.questions()).unwrap_or(u64::MAX);
    let progress = Progress::new(total, "questions");
    scan(&mut |step| {
        progress.set(u64::try_from(step.asked).unwrap_or(total));
        progress.say(&format!("{} baud, {} found", step.baud, step.found));
    })
}

fn all_good(found: &[FoundServo]) -> Result<(), CommandError> {
    let bad: Vec<String> = found
        .iter()
        .filter(|found| found.answers != AnswerQuality::Good)
        .map(|found| format!("id {} at {} baud: {}", found.id, found.baud, found.answers.name()))
        .collect();
    if bad.is_empty() { Ok(()) } else { Err(CommandError::Arm(bad.join("\n       "))) }
}
