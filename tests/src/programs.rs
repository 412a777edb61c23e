//! The programs under test: where they are, and how they are built when they are not.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The simulator.
#[must_use]
pub fn host_sim() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| program("host-sim", "host-sim"))
}

/// The command line tool.
#[must_use]
pub fn sevenbot() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| program("sevenbot-cli", "sevenbot"))
}

/// How long the tool waits for an answer, in milliseconds: the machine may have much else to do.
pub const TOOL_TIMEOUT: (&str, &str) = ("SEVENBOT_TIMEOUT", "10000");

/// The command line tool, patient.
#[must_use]
pub fn tool() -> Command {
    let mut tool = Command::new(sevenbot());
    tool.env(TOOL_TIMEOUT.0, TOOL_TIMEOUT.1);
    tool
}

/// The chores, one of which is the emulator.
#[must_use]
pub fn xtask() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| program("xtask", "xtask"))
}

/// The program `name` of this package. It stands two folders above the test: `target/debug/deps/test-0123`.
fn program(package: &str, name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a test knows where it is");
    let folder = test.ancestors().nth(2).expect("cargo's folders");
    let path = folder.join(name).with_extension(std::env::consts::EXE_EXTENSION);
    if !path.exists() {
        build(package, folder);
    }
    path
}

fn build(package: &str, folder: &Path) {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--quiet", "--package", package]);
    if folder.ends_with("release") {
        cargo.arg("--release");
    }
    let status = cargo.status().expect("cargo runs");
    assert!(status.success(), "{package} does not build");
}
