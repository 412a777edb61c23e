//! `cargo xtask test`: everything that has to hold, in one run. The steps are a table.

use std::time::Instant;

use crate::run::{CHIP, Outcome, cargo, run};
use crate::{count, decisions, deny, emulate, footprint, fuzz, no_panic, registers_md, torture};

/// A heading, and what is done under it.
type Step = (&'static str, fn() -> Outcome);

/// For each target. The corpora are tried whole, with the tests, where there is no fuzzer.
const FUZZ_SECONDS: u64 = 60;

/// What is done, in this order, until one fails. Tests come last: theirs is the last word.
const STEPS: &[Step] = &[
    ("tools that the tests need", install),
    ("format", || cargo("fmt --all --check")),
    ("lints, host", || cargo(&host("clippy", "--all-targets -- -D warnings"))),
    ("lints, what the firmware tests on the host", || {
        cargo("clippy -p firmware-stm32 --lib --tests -- -D warnings")
    }),
    ("lints, chip", || {
        cargo(&format!("clippy -p footprint -p firmware-stm32 --target {CHIP} -- -D warnings"))
    }),
    ("documentation", documentation),
    ("docs/registers.md is fresh", registers_md::check),
    ("every decision of docs/protocol.md has its tests", decisions::check),
    ("what comes in with dependencies", deny::rules),
    ("no panic can be reached", no_panic::check),
    ("flash, RAM and stack are within their budgets", || footprint::check(false)),
    ("instructions are within their budgets", || count::check(false)),
    ("programs under test", || cargo("build -p host-sim -p sevenbot -p xtask")),
    ("system tests, the image for the arm in an emulator", || {
        // The tool has no other code for this arm: its own tests are for the simulator's.
        let tests = ["wire", "registers", "motion", "settings", "servo_faults", "tool"];
        let words: String = tests.iter().map(|test| format!(" --test {test}")).collect();
        run("cargo", &format!("test -p system-tests{words}"), &[("ARM", "emulator")])
    }),
    ("30 virtual days in which everything goes wrong", torture::short),
    ("inputs that a fuzzer makes up", || fuzz::check(&fuzz::Options { seconds: FUZZ_SECONDS, seed: 1 })),
    ("tests", || cargo("test --workspace --exclude footprint")),
];

/// Carries out the steps.
pub(crate) fn all() -> Outcome {
    let start = Instant::now();
    for (number, (heading, step)) in (1..).zip(STEPS) {
        println!("\n=== {number}/{} {heading} (after {} s)", STEPS.len(), start.elapsed().as_secs());
        step().map_err(|why| format!("step {number}, {heading}: {why}"))?;
    }
    Ok(())
}

fn install() -> Outcome {
    run("rustup", "component add clippy rustfmt", &[])?;
    run("rustup", &format!("target add {CHIP}"), &[])?;
    if !emulate::has_qemu() {
        println!("{} is missing: installing it", emulate::QEMU);
        let installed = run("apt-get", "update", &[]).and_then(|()| {
            run("apt-get", &format!("install -y --no-install-recommends {}", emulate::QEMU), &[])
        });
        installed.map_err(|why| format!("{why}; {}", emulate::HOW_TO_GET_QEMU))?;
    }
    Ok(())
}

fn documentation() -> Outcome {
    run("cargo", &host("doc", "--no-deps"), &[("RUSTDOCFLAGS", "-D warnings")])
}

/// A cargo command for every package that builds for the host as a whole.
fn host(command: &str, words: &str) -> String {
    format!("{command} --workspace --exclude footprint --exclude firmware-stm32 {words}")
}
