//! The library crates as archives, as a registry would have them.

use std::fs;
use std::process::Command;

use super::sources;
use crate::run::{TaskResult, run_command, target_directory};

/// The libraries, in the order of publishing: dependencies first.
const LIBRARIES: [&str; 11] = [
    "kinematics",
    "protocol-core",
    "motion-core",
    "host-link",
    "arm-sim",
    "arm-model",
    "tty-ports",
    "sevenbot",
    "recording-formats",
    "classroom",
    "sevenbot-serve",
];

/// A line of the workspace's manifest. With this line, cargo does not find the packed libraries as dependencies of one another.
const NOT_PUBLISHED: &str = "\npublish = false\n";
const PUBLISHED: &str = "\npublish = true\n";

/// Packs each library, and builds it from its archive alone. Works in a copy of the sources that allows publishing.
pub(crate) fn build_from_archives() -> TaskResult {
    let copy = target_directory().join("dist-crates");
    sources::copy(&copy)?;
    let manifest = copy.join("Cargo.toml");
    let text = fs::read_to_string(&manifest)?;
    if !text.contains(NOT_PUBLISHED) {
        return Err("Cargo.toml does not contain `publish = false`".into());
    }
    fs::write(&manifest, text.replace(NOT_PUBLISHED, PUBLISHED))?;
    let mut cargo = Command::new("cargo");
    cargo.args(["package", "--quiet", "--allow-dirty"]);
    cargo.args(LIBRARIES.iter().flat_map(|name| ["--package", name])).current_dir(copy);
    run_command(cargo.env("CARGO_TARGET_DIR", target_directory().join("dist-archives")))
}
