//! The command line.

use std::time::Duration as RealTime;

use clap::{Parser, Subcommand};
use protocol_core::time::Duration;

use crate::campaign::{CampaignPlan, TimeBudget};
use crate::load;
use crate::scenario::{self, SCENARIOS, Scenario};

/// The virtual days of a campaign without `--days` and `--minutes`.
const DAYS: f64 = 30.0;

/// Simulates the whole arm with injected faults: the real controller, simulated servos, a flash that loses power, and
/// a host. Time is virtual, and a seed reproduces its world exactly.
#[derive(Clone, Debug, Parser)]
#[command(
    version,
    args_conflicts_with_subcommands = true,
    after_help = "\
EXIT STATUS
  0   no rule was violated
  1   one was: seed, virtual time and what led to it are printed
  2   an option cannot be used"
)]
pub struct CampaignArgs {
    #[command(subcommand)]
    /// A command other than the simulation.
    pub command: Option<TortureCommand>,

    /// Virtual days to simulate [default: 30]
    #[arg(long, conflicts_with = "minutes", value_parser = positive)]
    pub days: Option<f64>,

    /// Simulate for this many minutes of real time
    #[arg(long, value_parser = positive)]
    pub minutes: Option<f64>,

    /// Seed of the first world; the next world has the next seed
    #[arg(long, default_value_t = 1)]
    pub seed: u64,

    /// Simulate only this scenario
    #[arg(long, value_name = "NAME", value_parser = scenario)]
    pub scenario: Option<&'static Scenario>,

    /// Good frames for each kind of disturbance in the trials of the parser; 0 for no trials
    #[arg(long, default_value_t = 1_000_000)]
    pub frames: usize,

    /// Free motions to compare with those without protection; 0 for none
    #[arg(long, default_value_t = 1_000)]
    pub motions: u64,

    /// Print the rows of the table with tabs between the columns
    #[arg(long)]
    pub rows: bool,
}

/// A command other than the simulation.
#[derive(Clone, Debug, Subcommand)]
pub enum TortureCommand {
    /// Saturate a port with requests and count the missing replies
    Load(load::LoadArgs),
    /// Measure how far the arm sags during restarts of the controller, noise, and a silent servo
    Sag,
    /// Measure what becomes of the arm at walls, after alarms and after emergency stops, with and without protection
    Obstacles,
}

fn positive(text: &str) -> Result<f64, &'static str> {
    let number: Option<f64> = text.parse().ok();
    number.filter(|number| *number > 0.0 && *number < 1e6).ok_or("use a number above 0 and below 1,000,000")
}

fn scenario(name: &str) -> Result<&'static Scenario, String> {
    let names = || SCENARIOS.iter().map(|scenario| scenario.name).collect::<Vec<_>>().join(", ");
    scenario::find(name).ok_or_else(|| format!("use one of {}", names()))
}

impl CampaignArgs {
    /// The campaign that the arguments ask for.
    #[must_use]
    pub fn plan(&self) -> CampaignPlan {
        let budget = match self.minutes {
            Some(minutes) => TimeBudget::Real(RealTime::from_secs_f64(minutes * 60.0)),
            None => TimeBudget::Virtual(virtual_days(self.days.unwrap_or(DAYS))),
        };
        CampaignPlan {
            seed: self.seed,
            budget,
            scenario: self.scenario,
            frames: self.frames,
            motions: self.motions,
        }
    }
}

fn virtual_days(days: f64) -> Duration {
    RealTime::from_secs_f64(days * 86_400.0).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &str) -> Result<CampaignArgs, clap::Error> {
        CampaignArgs::try_parse_from(std::iter::once("torture").chain(arguments.split_whitespace()))
    }

    #[test]
    fn the_command_line_is_sound() {
        <CampaignArgs as clap::CommandFactory>::command().debug_assert();
    }

    #[test]
    fn a_plan_is_read_from_it() {
        let plan = parse("--days 0.5 --seed 7 --scenario storm").unwrap().plan();
        assert!(
            matches!(plan.budget, TimeBudget::Virtual(time) if time == Duration::from_millis(43_200_000))
        );
        assert_eq!((plan.seed, plan.scenario.map(|scenario| scenario.name)), (7, Some("storm")));
        assert!(matches!(parse("sag").unwrap().command, Some(TortureCommand::Sag)));
        let plan = parse("--minutes 2").unwrap().plan();
        assert!(matches!(plan.budget, TimeBudget::Real(time) if time == RealTime::from_secs(120)));
    }

    #[test]
    fn what_is_wrong_is_refused() {
        for arguments in ["--days 0", "--days x", "--days 1 --minutes 1", "--scenario weather", "load"] {
            assert!(parse(arguments).is_err(), "{arguments}");
        }
    }
}
