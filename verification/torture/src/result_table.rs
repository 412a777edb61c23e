//! The table of results: trials, their number, and failures.

use std::fmt::{self, Display};

use crate::campaign::{CampaignPlan, CampaignResult};
use crate::free_motion::FreeMotionTrial;
use crate::parser_trial::ParserTrial;
use crate::scenario::SCENARIOS;
use crate::text_table::Column::{Left, Right};
use crate::text_table::TextTable;
use crate::world_counts::WorldCounts;

/// A row: the trial, the amount of work, and the failures.
pub type ResultRow = [String; 3];

/// A row for each scenario with a completed world, for each total, for each trial and for the failed world, then the seed and the
/// speed of the simulation.
#[derive(Debug)]
pub struct ResultTable<'a>(pub &'a CampaignPlan, pub &'a CampaignResult);

/// Converts microseconds of virtual time to days.
#[must_use]
#[allow(clippy::cast_precision_loss)] // Shown with two decimals.
pub fn days(micros: u64) -> f64 {
    micros as f64 / 86_400e6
}

impl ResultTable<'_> {
    /// The rows without the heading.
    #[must_use]
    pub fn rows(&self) -> Vec<ResultRow> {
        let Self(_, outcome) = self;
        let mut rows = self.worlds();
        rows.extend(self.total());
        rows.extend(motion_row(&outcome.free_motion));
        rows.extend(outcome.parser_trials.iter().map(parser_row));
        if let Some(failure) = &outcome.failure {
            let trial = format!("{}: seed {}", failure.scenario.name, failure.seed);
            rows.push([trial, "1 world".to_owned(), failure.violation.to_string()]);
        }
        rows
    }

    /// The seed and the speed of the simulation.
    #[must_use]
    pub fn pace(&self) -> String {
        let Self(plan, outcome) = self;
        let minutes = outcome.elapsed.as_secs_f64() / 60.0;
        let days_per_minute = days(outcome.total().1.micros) / minutes.max(1e-9);
        format!(
            "seed {}, {minutes:.1} minutes for the worlds: {days_per_minute:.1} virtual days a minute",
            plan.seed
        )
    }

    fn worlds(&self) -> Vec<ResultRow> {
        let row = |scenario: &crate::scenario::Scenario| {
            let (worlds, counts) = self.1.worlds.get(scenario.name)?;
            Some(row(&format!("{}: {}", scenario.name, scenario.description), &amount(*worlds, counts)))
        };
        SCENARIOS.iter().filter_map(row).collect()
    }

    fn total(&self) -> Vec<ResultRow> {
        let (worlds, counts) = self.1.total();
        let WorldCounts {
            requests, replies, reports, alarms, corrupted_bursts, commands, engagements, ..
        } = counts;
        let WorldCounts { disturbed_servo_frames, undetected_errors, servo_faults, stalls, .. } = counts;
        let WorldCounts { obstacles, servo_trips, emergency_stops, checked_stops, .. } = counts;
        let WorldCounts { power_cuts, cut_starts, cut_saves, saves, .. } = counts;
        let counts = [
            ("all worlds", amount(worlds, &counts)),
            ("  complete requests", requests.to_string()),
            ("  checked replies, reports and alarms", format!("{replies}, {reports}, {alarms}")),
            ("  bursts of requests with corruption", corrupted_bursts.to_string()),
            ("  checked frames to the servos", commands.to_string()),
            ("  joints given torque at their position", engagements.to_string()),
            ("  corrupted or delayed frames on the servo bus", disturbed_servo_frames.to_string()),
            ("    of these, corrupted replies with a valid checksum", undetected_errors.to_string()),
            ("  changes of a servo fault, and restarts of a servo", servo_faults.to_string()),
            ("  walls, pushes, things between the claws, payloads", obstacles.to_string()),
            ("  overloads and heat forced on servos", servo_trips.to_string()),
            (
                "  emergency stops; of these long ones that had to end in state 0",
                format!("{emergency_stops}; {checked_stops}"),
            ),
            ("  stalls of the shell of up to 5 s", stalls.to_string()),
            (
                "  power cuts and restarts; of these during a start, during a save",
                format!("{power_cuts}; {cut_starts}, {cut_saves}"),
            ),
            ("  saved settings", saves.to_string()),
        ];
        counts.iter().map(|(trial, number)| row(trial, number)).collect()
    }
}

fn amount(worlds: u64, counts: &WorldCounts) -> String {
    format!("{worlds} worlds, {:.2} days", days(counts.micros))
}

fn row(trial: &str, number: &str) -> ResultRow {
    [trial.to_owned(), number.to_owned(), "none".to_owned()]
}

fn motion_row(trial: &FreeMotionTrial) -> Option<ResultRow> {
    let FreeMotionTrial { motions, bytes, different } = trial;
    let failures = if different.is_empty() {
        "none".to_owned()
    } else {
        format!("differ or are blocked: seeds {different:?}")
    };
    let number = format!("{motions} motions, {bytes} bytes to the servos");
    (*motions > 0).then(|| ["free motion, with and without protection".to_owned(), number, failures])
}

fn parser_row(trial: &ParserTrial) -> ResultRow {
    let verdict = if trial.passed() { "" } else { ": ABOVE THE LIMIT" };
    let failures = format!("{} lost, at most {} us late{verdict}", trial.lost, trial.worst_delay_us);
    [format!("parser, {}", trial.name), format!("{} frames", trial.frames), failures]
}

impl Display for ResultTable<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = TextTable::new([Left("trial"), Right("number"), Left("failures")]);
        self.rows().into_iter().for_each(|row| table.add(row));
        write!(out, "{table}{}", self.pace())
    }
}
