//! The closing table: what was tried, how many, what went wrong, and from which seed.

use std::fmt::{self, Display};

use crate::campaign::{Outcome, Plan};
use crate::parser::Line;
use crate::scenario::SCENARIOS;
use crate::tally::Tally;

/// A row: what was tried, how many, what went wrong.
pub type Row = [String; 3];

/// A plan and what came of it, as a table.
#[derive(Debug)]
pub struct Table<'a>(pub &'a Plan, pub &'a Outcome);

/// Virtual days.
#[must_use]
#[allow(clippy::cast_precision_loss)] // Shown with two decimals.
pub fn days(micros: u64) -> f64 {
    micros as f64 / 86_400e6
}

impl Table<'_> {
    /// The rows, less the heading.
    #[must_use]
    pub fn rows(&self) -> Vec<Row> {
        let Self(_, outcome) = self;
        let mut rows = self.worlds();
        rows.extend(self.total());
        rows.extend(outcome.lines.iter().map(parser_row));
        if let Some(failure) = &outcome.failure {
            let tried = format!("{}: seed {}", failure.scenario.name, failure.seed);
            rows.push([tried, "1 world".to_owned(), failure.violation.to_string()]);
        }
        rows
    }

    /// The seed, and how fast it went.
    #[must_use]
    pub fn pace(&self) -> String {
        let Self(plan, outcome) = self;
        let minutes = outcome.worlds_took.as_secs_f64() / 60.0;
        let a_minute = days(outcome.total().1.micros) / minutes.max(1e-9);
        format!(
            "seed {}, {minutes:.1} minutes for the worlds: {a_minute:.1} virtual days a minute",
            plan.seed
        )
    }

    fn worlds(&self) -> Vec<Row> {
        let row = |scenario: &crate::scenario::Scenario| {
            let (worlds, tally) = self.1.worlds.get(scenario.name)?;
            Some(row(&format!("{}: {}", scenario.name, scenario.about), &amount(*worlds, tally)))
        };
        SCENARIOS.iter().filter_map(row).collect()
    }

    fn total(&self) -> Vec<Row> {
        let (worlds, tally) = self.1.total();
        let Tally { requests, answers, reports, damaged_bursts, commands, engagements, .. } = tally;
        let Tally { damaged_servo_frames, deceptions, servo_faults, stalls, .. } = tally;
        let Tally { cuts, cut_starts, cut_saves, saves, .. } = tally;
        let counts = [
            ("all worlds", amount(worlds, &tally)),
            ("  whole requests from the host", requests.to_string()),
            ("  answers and reports to the host, each as it has to be", format!("{answers}, {reports}")),
            ("  bursts of requests with damage in or between them", damaged_bursts.to_string()),
            ("  frames to the servos, each judged", commands.to_string()),
            ("  joints given torque, each where it was", engagements.to_string()),
            ("  frames damaged or held up on the servo bus", damaged_servo_frames.to_string()),
            ("  of these, answers that no checksum spoke against", deceptions.to_string()),
            ("  servos made faulty, well again, or to start again", servo_faults.to_string()),
            ("  times the shell was late, by up to 5 s", stalls.to_string()),
            (
                "  power cuts and restarts; in a start, in a save",
                format!("{cuts}; {cut_starts}, {cut_saves}"),
            ),
            ("  settings saved", saves.to_string()),
        ];
        counts.iter().map(|(what, many)| row(what, many)).collect()
    }
}

fn amount(worlds: u64, tally: &Tally) -> String {
    format!("{worlds} worlds, {:.2} days", days(tally.micros))
}

fn row(tried: &str, many: &str) -> Row {
    [tried.to_owned(), many.to_owned(), "nothing".to_owned()]
}

fn parser_row(line: &Line) -> Row {
    let verdict = if line.is_good() { "" } else { ": TOO MUCH" };
    let wrong = format!("{} lost, {} us late at worst{verdict}", line.lost, line.worst_delay_us);
    [format!("parser, {}", line.name), format!("{} frames", line.frames), wrong]
}

impl Display for Table<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heading = ["what was tried", "how many", "what went wrong"].map(str::to_owned);
        for [tried, many, wrong] in std::iter::once(heading).chain(self.rows()) {
            writeln!(out, "{tried:<86} {many:>26}  {wrong}")?;
        }
        write!(out, "{}", self.pace())
    }
}
