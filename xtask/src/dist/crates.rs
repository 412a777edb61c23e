//! The library crates as archives, as a registry would have them.

use crate::run::{TaskResult, cargo};

/// The libraries. A registry gets those first on which others stand.
const LIBRARIES: [&str; 10] = [
    "kinematics",
    "protocol-core",
    "motion-core",
    "host-link",
    "arm-sim",
    "arm-model",
    "tty-ports",
    "sevenbot",
    "recording-formats",
    "sevenbot-serve",
];

/// Packs each library, and builds it from its archive alone.
pub(crate) fn build_from_archives() -> TaskResult {
    let packages: Vec<_> = LIBRARIES.iter().map(|name| format!("--package {name}")).collect();
    cargo(&format!("package --quiet --allow-dirty {}", packages.join(" ")))
}
