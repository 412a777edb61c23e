//! `cargo xtask bench`: comparison with peers, and measurements of the host programs. It has no budgets; `count` and `size`
//! have.

mod peers;
mod programs;
mod simulator;

use crate::run::{TaskResult, cargo};

/// Arguments of `cargo xtask bench`.
#[derive(clap::Args)]
pub(crate) struct BenchArgs {
    /// Measure the host programs instead: their size, start and round trip, and the load of 1, 10, 100 and 1000 simulated
    /// arms in one process
    #[arg(long)]
    programs: bool,
    /// Measure simulated arms in virtual time instead: 1, 10, 100 and 1000 of them, on one and two threads
    #[arg(long, conflicts_with = "programs")]
    simulation: bool,
}

/// Measures and prints.
pub(crate) fn run(args: &BenchArgs) -> TaskResult {
    match args {
        BenchArgs { programs: true, .. } => programs::measure(),
        BenchArgs { simulation: true, .. } => cargo("run --quiet --release --package bench --bin simulation"),
        _ => peers::compare(),
    }
}
