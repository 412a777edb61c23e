//! `cargo xtask test`: everything that has to hold, in one run. The steps are a table.
//!
//! No step leaves out what it cannot do: what a step needs is installed by the first one, and a step whose tool is
//! missing fails.

use clap::Args;

use crate::run::{CHIP, HOST, Outcome, build_for_browser, cargo, run};
use crate::steps::{Extent, Step, long, quick, whole};
use crate::{
    count, crate_graph, decisions, deny, drawings, footprint, fuzz, install, modules, no_panic, registers_md,
    start_up, steps, torture, trials, worlds,
};

/// How much is done.
#[derive(Args)]
pub(crate) struct Options {
    /// Only what is quick: format, lints, unit tests, properties, and the system tests on the simulator
    #[arg(long)]
    quick: bool,
    /// More of what takes long: torture, fuzzing, and the settings' tests in their long form
    #[arg(long, conflicts_with = "quick")]
    long: bool,
}

impl Options {
    const fn extent(&self) -> Extent {
        match (self.quick, self.long) {
            (true, _) => Extent::Quick,
            (_, true) => Extent::Long,
            _ => Extent::Whole,
        }
    }
}

/// Seconds of fuzzing for each target, from another seed in each run.
const LONG_FUZZ_SECONDS: u64 = 300;

/// What is done, in this order, until one fails. Tests come last: theirs is the last word.
const STEPS: &[Step] = &[
    quick("tools that the steps need", install::all),
    quick("format", || cargo("fmt --all --check")),
    quick("lints, host", || cargo(&format!("clippy {HOST} --all-targets -- -D warnings"))),
    quick("lints, what the firmware tests on the host", || {
        cargo("clippy -p firmware-stm32 --lib --tests -- -D warnings")
    }),
    quick("lints, chip", || {
        cargo(&format!("clippy -p footprint -p firmware-stm32 --target {CHIP} -- -D warnings"))
    }),
    quick("docs/registers.md is fresh", registers_md::check),
    quick("every decision of docs/protocol.md has its tests", decisions::check),
    quick("the picture of the crates in docs/design.md is fresh", crate_graph::check),
    quick("no cycle between files of a crate", modules::check),
    quick("the drawings in docs/circuits are fresh", drawings::check),
    quick("what comes in with dependencies", deny::rules),
    whole("documentation", || {
        run("cargo", &format!("doc {HOST} --no-deps"), &[("RUSTDOCFLAGS", "-D warnings")])
    }),
    whole("no panic can be reached", no_panic::check),
    whole("flash, RAM and stack are within their budgets", || footprint::check(false)),
    whole("the image starts as a chip needs it", start_up::check),
    whole("instructions are within their budgets", || count::check(false)),
    quick("the simulated arm builds for a browser, without an operating system", build_for_browser),
    quick("programs under test", || cargo(&format!("build {HOST}"))),
    whole("system tests, the image for the arm in an emulator", || worlds::test(&worlds::EMULATOR)),
    whole("system tests, the controller on this computer with servos behind a USB adapter", || {
        worlds::test(&worlds::ADAPTER)
    }),
    whole("virtual days in which everything goes wrong", torture::short),
    whole("inputs that a fuzzer makes up", fuzz::fixed),
    long("more virtual days in which everything goes wrong", torture::long),
    long("the settings' tests in their long form", || {
        let mut trials = trials::Trials::default();
        torture::journal(1, &mut trials)?;
        trials.finish(1)
    }),
    long("more inputs that a fuzzer makes up", || {
        fuzz::check(&fuzz::Options { seconds: LONG_FUZZ_SECONDS, seed: None, fixed: false })
    }),
    quick("tests, and the system tests on the simulator", || {
        // More threads than processors: most system tests wait for an arm that moves.
        let threads = [("RUST_TEST_THREADS", "8")];
        run("cargo", "test --workspace --exclude footprint", &threads)
    }),
];

/// Carries out the steps.
pub(crate) fn run_steps(options: &Options) -> Outcome {
    steps::carry_out(STEPS, options.extent())
}
