//! The paths of the programs under test. A program that is missing, or older than its source files, is built.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The path of `host-sim`, the simulator.
#[must_use]
pub fn host_sim() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| program("host-sim", "host-sim"))
}

/// The path of `sevenbot`, the command line tool.
#[must_use]
pub fn sevenbot() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| program("sevenbot-cli", "sevenbot"))
}

/// The environment variable for the timeout of the tool, and its value in milliseconds. The value is large, because the
/// machine may be busy.
pub const TOOL_TIMEOUT: (&str, &str) = ("SEVENBOT_TIMEOUT", "10000");

/// The command line tool, with a long timeout.
#[must_use]
pub fn tool() -> Command {
    let mut tool = Command::new(sevenbot());
    tool.env(TOOL_TIMEOUT.0, TOOL_TIMEOUT.1);
    tool
}

/// The program that starts the emulator.
#[must_use]
pub fn xtask() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| program("xtask", "xtask"))
}

/// The path of the program `name`: for a test in `target/debug/deps`, the program is in `target/debug`. Builds the package if
/// the program is not current.
fn program(package: &str, name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("the path of the test");
    let folder = test.ancestors().nth(2).expect("cargo's folders");
    let path = folder.join(name).with_extension(std::env::consts::EXE_EXTENSION);
    if !is_current(&path) {
        build(package, folder);
    }
    path
}

/// Does the program exist, and is it newer than the files that cargo lists beside it?
fn is_current(program: &Path) -> bool {
    let time = |path: &Path| path.metadata().and_then(|metadata| metadata.modified()).ok();
    let Some(built) = time(program) else { return false };
    let list = std::fs::read_to_string(program.with_extension("d")).unwrap_or_default();
    let sources = list.split_once(": ").map_or("", |(_, sources)| sources);
    sources.split_whitespace().all(|source| time(Path::new(source)).is_none_or(|changed| changed <= built))
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
