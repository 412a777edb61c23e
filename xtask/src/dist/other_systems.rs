//! Lints the code for Windows and macOS. This needs neither these systems nor their linkers.

use std::process::Command;

use super::platform::{WINDOWS, add_target};
use crate::run::{TaskResult, root, run_command, target_directory};

/// Our code is the same for both kinds of Mac.
const SYSTEMS: [&str; 2] = [WINDOWS.triple, "aarch64-apple-darwin"];
/// All other crates that run there are dependencies of these.
const PACKAGES: [&str; 3] = ["sevenbot-cli", "sevenbot-python", "sevenbot-serve"];

/// Lints the packages. Nothing is linked, so the C code of their dependencies is not needed: the program `true` replaces the C
/// compiler and the archiver.
pub(crate) fn lint_other_systems() -> TaskResult {
    // A folder of its own: another build runs at the same time, and would wait for the lock of a common folder.
    let folder = target_directory().join("other-systems");
    for system in SYSTEMS {
        add_target(system)?;
        let mut clippy = Command::new("cargo");
        clippy.args(["clippy", "--quiet", "--target", system, "--target-dir"]).arg(&folder);
        clippy.args(PACKAGES.iter().flat_map(|package| ["--package", package]));
        for tool in ["CC", "AR"] {
            clippy.env(format!("{tool}_{}", system.replace('-', "_")), "true");
        }
        run_command(clippy.args(["--", "-D", "warnings"]).current_dir(root()))?;
    }
    Ok(())
}
