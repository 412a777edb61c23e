//! `cargo xtask bench`: speed beside peers, and figures of the host programs. It only prints; `count` and `size` check
//! budgets.

mod peers;
mod programs;
mod simulator;

use crate::run::Outcome;

/// Options of `cargo xtask bench`.
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
