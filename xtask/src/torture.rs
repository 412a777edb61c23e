//! `cargo xtask torture`: all searches for faults in one run, with one table at the end.
//!
//! ```text
//!   torture   worlds with injected faults                  half of the time
//!             free motion, with and without protection     a thousand motions
//!             the parser on a disturbed line               a million frames for each disturbance
//!   journal   the long forms of its tests                  all of them
//!   fuzz      six targets                                  a twelfth of the time for each
//! ```

use clap::Args;

use crate::fuzz;
use crate::run::{self, TaskResult};
use crate::trials::Trials;

/// The time and the seed.
#[derive(Args)]
pub(crate) struct TortureArgs {
    /// Minutes of real time for the worlds and the fuzzer together; the rest takes about ten more
    #[arg(long, default_value_t = 20.0, value_parser = minutes)]
    minutes: f64,
    /// Seed of the first world and of all other trials
    #[arg(long, default_value_t = 1)]
    seed: u32,
}

fn minutes(text: &str) -> Result<f64, &'static str> {
    let number: Option<f64> = text.parse().ok();
    number.filter(|number| *number > 0.0 && *number < 1e6).ok_or("use a number above 0")
}

/// The short form, 10 virtual days, with the same worlds every time.
pub(crate) fn short() -> TaskResult {
    days(10)
}

/// The long form, 30 virtual days, which begin with the worlds of the short form.
pub(crate) fn long() -> TaskResult {
    days(30)
}

/// Runs worlds at a low priority: the steps that run at the same time depend on real time, but the worlds do not.
fn days(days: u32) -> TaskResult {
    let worlds = format!("--days {days} --seed 1 --frames 0 --motions 200");
    run::run("nice", &format!("cargo run --quiet --release --package torture -- {worlds}"), &[])
}

pub(crate) fn run(args: &TortureArgs) -> TaskResult {
    let TortureArgs { minutes, seed } = args;
    let mut trials = Trials::default();
    let half = minutes / 2.0;
    trials.take(
        &format!("cargo run --release --package torture -- --minutes {half} --seed {seed} --rows"),
        &[],
    )?;
    journal(*seed, &mut trials)?;
    let seconds = std::time::Duration::try_from_secs_f64(half * 10.0)?.as_secs().max(1);
    fuzz::all(seconds, *seed, &mut trials)?;
    trials.finish(u64::from(*seed))
}

/// Runs the long forms of the tests of the settings.
pub(crate) fn journal(seed: u32, trials: &mut Trials) -> TaskResult {
    let tests = "power_loss:: journal_faults::";
    trials.take(
        &format!(
            "cargo test --package protocol-core --test all -- {tests} --include-ignored --nocapture --quiet"
        ),
        &[("JOURNAL_LONG", "1"), ("JOURNAL_SEED", &seed.to_string())],
    )
}
