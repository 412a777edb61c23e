//! `cargo xtask coverage`: the coverage of the cores by their own tests, and its lower limits.
//!
//! Counts lines, functions and regions (branches of expressions). A covered line may still be untested; `cargo mutants` shows
//! such lines.

use crate::run::{TaskResult, run};

/// The tests of the cores, and the lower limits in percent. The run skips tests that repeat the same paths millions of times,
/// because they take minutes with counters. Most of the missing regions are unreachable match arms: see docs/reliability.md.
const RUN: &str = "llvm-cov --package protocol-core --package motion-core --package kinematics --summary-only \
                   --fail-under-lines 100 --fail-under-functions 100 --fail-under-regions 99 \
                   --ignore-filename-regex (arm-sim|flash-model|tests)/ \
                   -- --skip any_one_wrong_bit --skip a_cut_at_every_step --skip a_second_cut --skip cuts_at_random";

/// Runs the tests, prints a table by file, and fails below a limit.
pub(crate) fn check() -> TaskResult {
    if run("cargo", "llvm-cov --version", &[]).is_err() {
        return Err("install it first: cargo install cargo-llvm-cov --locked && rustup component add \
                    llvm-tools"
            .into());
    }
    run("cargo", RUN, &[])
}
