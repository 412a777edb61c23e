//! Running the programs the chores are made of. Knows no chore.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// What a chore comes to: a failure says what to do about it.
pub(crate) type Outcome<T = ()> = Result<T, Box<dyn Error>>;

/// The target of the chip.
pub(crate) const CHIP: &str = "thumbv7em-none-eabihf";

/// The root of the workspace, wherever the chore was started from.
pub(crate) fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here)
}

/// Runs cargo with these words, at the root of the workspace.
pub(crate) fn cargo(words: &str) -> Outcome {
    run("cargo", words, &[])
}

/// Runs a program at the root of the workspace and waits for it; its output goes where ours goes.
pub(crate) fn run(program: &str, words: &str, variables: &[(&str, &str)]) -> Outcome {
    let status = Command::new(program)
        .args(words.split_whitespace())
        .envs(variables.iter().copied())
        .current_dir(root())
        .status()
        .map_err(|why| format!("cannot start `{program}`: {why}"))?;
    if status.success() { Ok(()) } else { Err(format!("`{program} {words}` failed").into()) }
}

/// Links the programs of `footprint` for the chip and reads one of them.
pub(crate) fn linked(program: &str) -> Outcome<Vec<u8>> {
    let path = target_directory().join(CHIP).join("chip").join(program);
    fs::read(&path).map_err(|why| format!("cannot read {}: {why}", path.display()).into())
}

/// Links the programs of `footprint` for the chip.
pub(crate) fn link_footprint() -> Outcome {
    run("rustup", &format!("--quiet target add {CHIP}"), &[])?;
    cargo(&format!("build --quiet --package footprint --target {CHIP} --profile chip"))
}

fn target_directory() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |set| root().join(set))
}
