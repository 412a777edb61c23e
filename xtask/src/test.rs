//! `cargo xtask test`: all checks and tests in one run.
//!
//! No step of the chosen scope is skipped: the first step installs the tools that each run needs, and a step without its tool
//! fails.

use clap::Args;

use crate::run::{self, CHECKED, CHIP, TESTED, TaskResult, build_for_browser, cargo, run};
use crate::steps::{self, Stage, TestScope, long, quick, whole};
use crate::{
    count, deny, dist, docs, footprint, fuzz, install, lerobot, modules, mujoco, no_panic, python, replays,
    ros, system_tests, torture, trials, web,
};

/// The scope of the run.
#[derive(Args)]
pub(crate) struct TestArgs {
    /// Run the quick steps only: format, lints, unit and property tests, and the system tests on the simulator
    #[arg(long)]
    quick: bool,
    /// Run the long steps too, such as more torture and fuzzing, the model in MuJoCo, whole releases, Ray and LeRobot
    #[arg(long, conflicts_with = "quick")]
    long: bool,
    /// Do the work of one step: how the run itself starts it
    #[arg(long, hide = true, value_name = "HEADING")]
    step: Option<String>,
}

impl TestArgs {
    const fn scope(&self) -> TestScope {
        match (self.quick, self.long) {
            (true, _) => TestScope::Quick,
            (_, true) => TestScope::Long,
            _ => TestScope::Whole,
        }
    }
}

/// Seconds of fuzzing for each target, with another seed in each run.
const LONG_FUZZ_SECONDS: u64 = 300;

/// The stages, in order. A run ends when a step fails. Steps that mostly wait run beside steps that compute. The tests that every
/// run includes come last, so that their output is at the end.
const STAGES: &[Stage] = &[
    &[&[quick("tools that the steps need", install::all), quick("format", || cargo("fmt --all --check"))]],
    &[
        // These steps share the build directory of the tests.
        &[
            quick("lints, host", || cargo(&format!("clippy {CHECKED} --all-targets -- -D warnings"))),
            quick("lints, host tests of the firmware", || {
                cargo("clippy -p firmware-stm32 --lib --tests -- -D warnings")
            }),
            quick("lints, chip", || {
                cargo(&format!("clippy -p footprint -p firmware-stm32 --target {CHIP} -- -D warnings"))
            }),
            quick("generated documents are up to date, and every decision has tests", docs::check),
            quick("no cycle between files of a crate", modules::check),
            quick("licences, versions and sources of dependencies", deny::rules),
            whole("documentation", || {
                run("cargo", &format!("doc {CHECKED} --no-deps"), &[("RUSTDOCFLAGS", "-D warnings")])
            }),
            quick("the simulated arm builds for a browser, without an operating system", build_for_browser),
            // One of the programs contains the page.
            quick("the page builds within its budget", web::build),
            quick("programs and tests", || cargo(&format!("test {TESTED} --no-run"))),
        ],
        // These steps run beside them in other build directories: cargo allows one build at a time in each.
        &[
            quick("lints, Windows and macOS", dist::lint_other_systems),
            whole("no panic is reachable", no_panic::check),
            whole("flash, RAM and stack are within their budgets", || footprint::check(false)),
        ],
    ],
    &[
        // These steps compute. The counts come after the first tests on an emulated chip.
        &[
            whole("start-up of the image", run::start_up),
            whole("recorded sessions, natively and in a WebAssembly module", replays::short),
            whole("instructions are within their budgets", || count::check(false)),
            whole("worlds with injected faults", torture::short),
            whole("fuzzing", fuzz::fixed),
        ],
        // These steps run beside them, and mostly wait for an arm, a browser or a network.
        &[
            whole("system tests, the image for the arm in an emulator", || {
                system_tests::run_on(&system_tests::EMULATOR)
            }),
            whole("system tests, the controller on this computer with servos behind a USB adapter", || {
                system_tests::run_on(&system_tests::ADAPTER)
            }),
            whole("the page in a browser", || {
                let variables = [("RUST_TEST_THREADS", "1"), ("POSES", "1000")];
                run("cargo", &format!("test {TESTED} --test browser"), &variables)
            }),
            whole("the Python package", python::check),
            whole("the ROS packages", ros::check),
        ],
    ],
    &[&[
        long("more recorded sessions", replays::long),
        long("more worlds with injected faults", torture::long),
        long("the settings' tests in their long form", || {
            let mut trials = trials::Trials::default();
            torture::journal(1, &mut trials)?;
            trials.finish(1)
        }),
        long("the linkage between all pairs of whole degrees", || {
            cargo("test --release -p motion-core --test all linkage -- --ignored")
        }),
        long("the arm's model in MuJoCo", mujoco::check),
        long("each library builds from its archive", dist::build_from_archives),
        long("this computer's part of a release, installed on a bare system", dist::native),
        long("a whole release, with each part installed and used", dist::whole),
        long("many arms in two processes, with Ray", python::ray),
        long("the plugin for LeRobot, with the base classes of LeRobot", lerobot::check),
        long("LeRobot's own commands, on the simulator and on the image in an emulator", lerobot::commands),
        long("more fuzzing", || {
            fuzz::check(&fuzz::FuzzArgs { seconds: LONG_FUZZ_SECONDS, seed: None, fixed: false })
        }),
        quick("tests of the tasks", || cargo("test --package xtask")),
    ]],
    &[
        &[quick("unit and property tests, and examples of the documentation", || {
            test("--exclude system-tests")
        })],
        &[quick("system tests, the simulator", || test("--test system"))],
    ],
    &[&[quick("every command with every fault of the simulator", || test("--test faults"))]],
];

/// Runs these tests in 8 threads, even with fewer processors, because most tests with an arm wait for it.
fn test(which: &str) -> TaskResult {
    run("cargo", &format!("test {TESTED} {which}"), &[("RUST_TEST_THREADS", "8")])
}

/// Runs the steps, or does the work of one of them.
pub(crate) fn run_steps(options: &TestArgs) -> TaskResult {
    match &options.step {
        Some(heading) => steps::act_of(STAGES, heading),
        None => steps::run(STAGES, options.scope(), steps::execute),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use crate::run::root;

    #[test]
    fn each_file_of_the_system_tests_has_a_step() {
        let mut files: Vec<_> = fs::read_dir(root().join("tests/tests"))
            .unwrap()
            .flatten()
            .map(|file| file.file_name())
            .collect();
        files.sort_unstable();
        assert_eq!(files, ["faults", "system"]);
    }
}
