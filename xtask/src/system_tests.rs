//! The system tests on other kinds of arms than the simulator.
//!
//! If the arm lacks a capability, the tests that need it are skipped by their names. Such a test fails if its name is missing
//! here: see `with_arm` in `tests/src/test_arm.rs`.

use crate::run::{TESTED, TaskResult, run};

/// The system tests for a kind of arm.
pub(crate) struct SystemTests {
    /// The value of the variable `ARM`.
    arm: &'static str,
    /// The modules of `tests/tests/system` to run, as prefixes of the names of their tests.
    modules: &'static [&'static str],
    /// The skipped tests, each after its reason.
    skipped: &'static [&'static str],
}

/// The system tests of the firmware image in the emulator.
pub(crate) const EMULATOR: SystemTests = SystemTests {
    arm: "emulator",
    // Most tests of the tool test its own code, which does not depend on the arm. The emulator's flash does not change, so the
    // tests of the settings after a restart are left out.
    modules: &[
        "device::wire::",
        "device::registers::",
        "device::motion::",
        "device::servo_faults::",
        "device::self_test::",
        "device::maker_clients::",
        "tool::basics::",
        "tool::map21::",
    ],
    skipped: &[
        // The chip id of the emulator cannot be chosen.
        "d08_the_registers_hold_the_chip_id",
        "info_shows_identity_and_status",
        // The test needs a setting after a restart.
        "d14_reports_take_at_most_half_of_a_slow_line",
        // The test fills the storage.
        "set_reports_a_full_storage",
        // A chip does not notice who has its port open.
        "m12_the_next_program_starts_afresh",
    ],
};

/// The controller on this computer, with simulated servos behind a simulated USB adapter.
pub(crate) const ADAPTER: SystemTests = SystemTests {
    arm: "adapter",
    modules: &[
        "device::wire::",
        "device::registers::",
        "device::motion::",
        "device::settings::",
        "device::servo_faults::",
        "device::maker_clients::",
        "tool::basics::",
        "tool::map21::",
    ],
    skipped: &[],
};

/// Runs the system tests on this kind of arm.
pub(crate) fn run_on(tests: &SystemTests) -> TaskResult {
    let modules = tests.modules.join(" ");
    let skipped: String = tests.skipped.iter().map(|test| format!(" --skip {test}")).collect();
    let words = format!("test {TESTED} --test system -- {modules}{skipped}");
    run("cargo", &words, &[("ARM", tests.arm), ("ARM_MEETS_ALL_NEEDS", "1")])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::root;

    /// A filter that selects no test would pass.
    #[test]
    fn the_modules_exist() {
        for module in [EMULATOR, ADAPTER].iter().flat_map(|tests| tests.modules) {
            let file = module.trim_end_matches("::").replace("::", "/");
            assert!(root().join(format!("tests/tests/system/{file}.rs")).is_file(), "{module}");
        }
    }
}
