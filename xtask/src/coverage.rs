//! `cargo xtask coverage`: what the cores' own tests run through, held against what they have to.
//!
//! Counts lines, functions and regions: branches of expressions, as the compiler sees them. A line that was run
//! through may still not be tested; `cargo mutants` says which.

use crate::run::{Outcome, run};

/// The tests of both cores, and the least they may cover, in percent. Left out are those that go the same ways
/// millions of times, which takes minutes where each step is counted. The regions that are missing are
/// for the most part arms that nothing leads to: docs/reliability.md lists them.
const RUN: &str = "llvm-cov --package protocol-core --package motion-core --summary-only \
                   --fail-under-lines 100 --fail-under-functions 100 --fail-under-regions 99 \
                   --ignore-filename-regex (arm-sim|flash-model|tests)/ \
                   -- --skip any_one_wrong_bit --skip a_cut_at_every_step --skip a_second_cut --skip cuts_at_random";

/// Runs the tests, prints a table by file, and fails if something is not covered.
pub(crate) fn check() -> Outcome {
    if run("cargo", "llvm-cov --version", &[]).is_err() {
        return Err("install it first: cargo install cargo-llvm-cov --locked && rustup component add \
                    llvm-tools"
            .into());
    }
    run("cargo", RUN, &[])
}
