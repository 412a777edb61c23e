//! The system tests on arms of other kinds than the simulator's own: which tests each kind can pass.
//!
//! A test that needs what such an arm does not have is left out by its name. The tests are run so that one that is
//! left out by mistake, or not at all, fails: see `with_arm` in `tests/src/test_arm.rs`.

use crate::run::{Outcome, run};

/// A kind of arm.
pub(crate) struct World {
    /// The value of the variable `ARM`.
    name: &'static str,
    /// The files of `tests/tests` that are run.
    files: &'static [&'static str],
    /// Tests of these files that this arm cannot pass, each below its reason.
    left_out: &'static [&'static str],
}

/// The image for the arm in the emulator.
pub(crate) const EMULATOR: World = World {
    name: "emulator",
    // The tool has no other code for this arm: its own tests are for the simulator's. The emulator's flash keeps
    // nothing, and all tests of the settings need some that does.
    files: &["wire", "registers", "motion", "servo_faults", "tool", "self_test"],
    left_out: &[
        // The emulated chip has no unique id to choose.
        "d08_the_registers_hold_the_chip_id",
        "info_shows_identity_and_status",
        // A setting has to be kept over a restart.
        "d14_reports_take_at_most_half_of_a_slow_line",
        // The storage has to take settings until it is full.
        "set_reports_a_full_storage",
    ],
};

/// The controller on this computer, with simulated servos behind a simulated USB adapter.
pub(crate) const ADAPTER: World = World {
    name: "adapter",
    files: &["wire", "registers", "motion", "settings", "servo_faults", "tool"],
    left_out: &[],
};

/// Runs the system tests on arms of this kind.
pub(crate) fn test(world: &World) -> Outcome {
    // Chosen out of the whole workspace, so that nothing is built a second time with other features.
    let files: String = world.files.iter().map(|file| format!(" --test {file}")).collect();
    let left_out: String = world.left_out.iter().map(|test| format!(" --skip {test}")).collect();
    let words = format!("test --workspace --exclude footprint{files} -- {left_out}");
    run("cargo", &words, &[("ARM", world.name), ("ARM_MEETS_ALL_NEEDS", "1")])
}
