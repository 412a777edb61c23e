//! `cargo xtask torture`: everything that tries to break the arm, in one go, and one table at the end.
//!
//! ```text
//!   torture   the whole arm in worlds that go wrong        half of the time
//!             the parser on a disturbed line               a million frames for each disturbance
//!   journal   its tests' long forms                        all of them
//!   fuzz      six targets                                  the other half of the time
//! ```
//!
//! Knows what to run and for how long, not what is tried.

use clap::Args;

use crate::fuzz;
use crate::run::{Outcome, cargo};
use crate::trials::Trials;

/// How much is tried, and from where.
#[derive(Args)]
pub(crate) struct Options {
    /// Minutes of real time for the worlds and the fuzzer together. The rest takes about ten more
    #[arg(long, default_value_t = 20.0, value_parser = minutes)]
    minutes: f64,
    /// The seed of the first world, and of all other chance
    #[arg(long, default_value_t = 1)]
    seed: u32,
}

fn minutes(text: &str) -> Result<f64, &'static str> {
    let number: Option<f64> = text.parse().ok();
    number.filter(|number| *number > 0.0 && *number < 1e6).ok_or("use a number above 0")
}

/// The short form, 10 virtual days: the same worlds every time.
pub(crate) fn short() -> Outcome {
    days(10)
}

/// The long form, 30 virtual days: likewise, and begins with the worlds of the short one.
pub(crate) fn long() -> Outcome {
    days(30)
}

fn days(days: u32) -> Outcome {
    cargo(&format!("run --quiet --release --package torture -- --days {days} --seed 1 --frames 0"))
}

/// Tries everything.
pub(crate) fn run(options: &Options) -> Outcome {
    let Options { minutes, seed } = options;
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

/// The long forms of the tests of the settings.
pub(crate) fn journal(seed: u32, trials: &mut Trials) -> Outcome {
    let tests = "--test power_loss --test journal_faults";
    trials.take(
        &format!("cargo test --package protocol-core {tests} -- --include-ignored --nocapture --quiet"),
        &[("JOURNAL_LONG", "1"), ("JOURNAL_SEED", &seed.to_string())],
    )
}
