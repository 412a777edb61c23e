//! `cargo xtask bench`: how fast, how small, how many. Prints; the budgets are held by `count` and `size`.

mod peers;
mod programs;
mod simulator;

use crate::run::Outcome;

/// What is measured.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Instead, measure the programs: their size and start, a round trip, and what 1, 10, 100 and 1000 simulated
    /// arms in one process take
    #[arg(long)]
    programs: bool,
}

/// Measures and prints.
pub(crate) fn run(options: &Options) -> Outcome {
    if options.programs { programs::measure() } else { peers::compare() }
}
