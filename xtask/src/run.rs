//! Builds and runs programs for the tasks.

use std::path::Path;
use std::process::Command;
use std::{fs, io};

pub(crate) use emulator::chip_program::{CHIP, ChipProgram, IMAGE, root, target_directory};
pub(crate) use emulator::process::{ChildProcess, TaskResult, wait_for};

/// The target triple of a browser.
pub(crate) const BROWSER: &str = "wasm32-unknown-unknown";

/// The packages whose programs and tests are built for the host. Most commands select the same packages, because another
/// selection may enable other features, and then their dependencies are built again. `cargo xtask` has built xtask before.
pub(crate) const TESTED: &str = "--workspace --exclude footprint --exclude xtask";
/// The packages that are linted and documented for the host.
pub(crate) const CHECKED: &str = "--workspace --exclude footprint --exclude firmware-stm32";

/// Runs cargo with these arguments, in the root of the workspace.
pub(crate) fn cargo(words: &str) -> TaskResult {
    run("cargo", words, &[])
}

/// Runs a program in the root of the workspace, with our standard output, and waits for its end.
pub(crate) fn run(program: &str, words: &str, variables: &[(&str, &str)]) -> TaskResult {
    let status = Command::new(program)
        .args(words.split_whitespace())
        .envs(variables.iter().copied())
        .current_dir(root())
        .status()
        .map_err(|why| format!("cannot start `{program}`: {why}"))?;
    if status.success() { Ok(()) } else { Err(format!("`{program} {words}` failed").into()) }
}

/// Runs a program, and waits for its end.
pub(crate) fn run_command(command: &mut Command) -> TaskResult {
    let status = command.status().map_err(|why| format!("cannot start {command:?}: {why}"))?;
    if status.success() { Ok(()) } else { Err(format!("{command:?} failed").into()) }
}

/// The profile of `footprint` for size, and the one for speed.
pub(crate) const SMALL: &str = "chip";
pub(crate) const FAST: &str = "chip-fast";

/// The path from bytes to reply alone.
pub(crate) const ANSWER: ChipProgram = ChipProgram { name: "answer", profile: SMALL };

/// The programs of `footprint` with parts of the cores, and the image.
const LINKED: &[ChipProgram] = &[
    ANSWER,
    ChipProgram { name: "arm", profile: SMALL },
    ChipProgram { name: "journal", profile: SMALL },
    ChipProgram { name: "kinematics", profile: SMALL },
    ChipProgram { name: "unused_by_arm_motion", profile: SMALL },
    ChipProgram { name: "unused_by_arm_protocol", profile: SMALL },
    IMAGE,
];

/// Links the programs for the chip.
pub(crate) fn link() -> TaskResult<&'static [ChipProgram]> {
    build_image()?;
    build_footprint(SMALL)?;
    Ok(LINKED)
}

/// Makes a folder empty, and creates it if it does not exist.
pub(crate) fn empty_folder(folder: &Path) -> io::Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    fs::create_dir_all(folder)
}

pub(crate) fn build_image() -> TaskResult {
    run("rustup", &format!("--quiet target add {CHIP}"), &[])?;
    cargo("fw --quiet")
}

/// Builds the image, and runs an example of the crate `emulator` that measures it.
pub(crate) fn experiment(name: &str) -> TaskResult {
    emulator::need_qemu().and_then(|()| build_image())?;
    cargo(&format!("run --quiet -p emulator --example {name}"))
}

/// Builds the image, and tests its start in the emulator.
pub(crate) fn start_up() -> TaskResult {
    emulator::need_qemu().and_then(|()| build_image())?;
    cargo(&format!("test {TESTED} --test start_up -- --include-ignored --nocapture"))
}

/// Builds the simulator through one of its tests, so that cargo selects the same features as for all tests.
pub(crate) fn build_host_sim() -> TaskResult {
    cargo(&format!("test --quiet {TESTED} --test simulator --no-run"))
}

/// Builds the simulated arm and its kinematics for a browser, without an operating system.
pub(crate) fn build_for_browser() -> TaskResult {
    run("rustup", &format!("--quiet target add {BROWSER}"), &[])?;
    cargo(&format!("build --package arm-sim --package kinematics --target {BROWSER}"))
}

/// Builds the programs of `footprint` with a profile.
pub(crate) fn build_footprint(profile: &str) -> TaskResult {
    cargo(&format!("build --quiet --package footprint --target {CHIP} --profile {profile}"))
}
