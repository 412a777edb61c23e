//! The closing table: what was tried, how many, what went wrong, and from which seed.

use std::fmt::{self, Display};

use crate::campaign::{Outcome, Plan};
use crate::parser::Line;
use crate::scenario::SCENARIOS;
use crate::tally::Tally;

/// A plan and what came of it, as a table.
#[derive(Debug)]
pub struct Table<'a>(pub &'a Plan, pub &'a Outcome);

/// Virtual days.
#[must_use]
#[allow(clippy::cast_precision_loss)] // Shown with two decimals.
pub fn days(micros: u64) -> f64 {
    micros as f64 / 86_400e6
}

impl Display for Table<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(plan, outcome) = self;
        row(out, "what was tried", "how many", "went wrong")?;
        writeln!(out, "{}", "-".repeat(112))?;
        for scenario in &SCENARIOS {
            let Some((worlds, tally)) = outcome.worlds.get(scenario.name) else { continue };
            let tried = format!("{}: {}", scenario.name, scenario.about);
            let many = format!("{worlds} worlds, {:.2} days", days(tally.micros));
            row(out, &tried, &many, "nothing")?;
        }
        self.total(out)?;
        for line in &outcome.lines {
            parser_row(out, line)?;
        }
        if let Some(failure) = &outcome.failure {
            let tried = format!("{}: seed {}", failure.scenario.name, failure.seed);
            row(out, &tried, "1 world", &failure.violation.to_string())?;
        }
        write!(out, "seed {}", plan.seed)?;
        let minutes = outcome.worlds_took.as_secs_f64() / 60.0;
        let (_, tally) = outcome.total();
        let a_minute = days(tally.micros) / minutes.max(1e-9);
        write!(out, ", {minutes:.1} minutes for the worlds: {a_minute:.1} virtual days a minute")
    }
}

impl Table<'_> {
    fn total(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (worlds, tally) = self.1.total();
        let many = format!("{worlds} worlds, {:.2} days", days(tally.micros));
        row(out, "all worlds", &many, "")?;
        let Tally { requests, answers, reports, damaged_bursts, commands, engagements, .. } = tally;
        let Tally { damaged_servo_frames, deceptions, servo_faults, stalls, .. } = tally;
        let Tally { cuts, cut_starts, cut_saves, saves, .. } = tally;
        for (what, many) in [
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
        ] {
            row(out, what, &many, "")?;
        }
        Ok(())
    }
}

fn parser_row(out: &mut fmt::Formatter<'_>, line: &Line) -> fmt::Result {
    let tried = format!("parser, {}", line.name);
    let delay = line.worst_delay_us;
    let verdict = if line.is_good() { "" } else { ": TOO MUCH" };
    let wrong = format!("{} lost, {delay} us late at worst{verdict}", line.lost);
    row(out, &tried, &format!("{} frames", line.frames), &wrong)
}

fn row(out: &mut fmt::Formatter<'_>, tried: &str, many: &str, wrong: &str) -> fmt::Result {
    let line = format!("{tried:<72} {many:<26} {wrong}");
    writeln!(out, "{}", line.trim_end())
}
