//! Runs the programs that the tasks consist of.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::thread::sleep;
use std::time::{Duration, Instant};
use std::{env, fs};

/// The result of a task. An error tells what to do.
pub(crate) type TaskResult<T = ()> = Result<T, Box<dyn Error>>;

/// The target triple of the chip.
pub(crate) const CHIP: &str = "thumbv7em-none-eabihf";
/// The target triple of a browser.
pub(crate) const BROWSER: &str = "wasm32-unknown-unknown";

/// The packages whose programs and tests are built for the host. All commands select the same packages, because another
/// selection may enable other features, and then their dependencies are built again. The tasks are built before.
pub(crate) const TESTED: &str = "--workspace --exclude footprint --exclude xtask";
/// The packages with all their targets for the host.
pub(crate) const CHECKED: &str = "--workspace --exclude footprint --exclude firmware-stm32";

/// The root of the workspace.
pub(crate) fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here)
}

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

/// The timeout of all waits. It is long, because the machine may be busy.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(60);

/// Polls until there is a value.
pub(crate) fn wait_for<T>(event: &str, mut poll: impl FnMut() -> TaskResult<Option<T>>) -> TaskResult<T> {
    let deadline = Instant::now() + TIMEOUT;
    while Instant::now() < deadline {
        if let Some(value) = poll()? {
            return Ok(value);
        }
        sleep(Duration::from_millis(5));
    }
    Err(format!("timeout: {event}"))?
}

/// A child process that is killed when it is dropped.
pub(crate) struct ChildProcess(pub(crate) Child);

impl Drop for ChildProcess {
    fn drop(&mut self) {
        // An error means that it has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A linked program for the chip.
pub(crate) struct ChipProgram {
    /// Its name.
    pub(crate) name: &'static str,
    /// Its build profile.
    pub(crate) profile: &'static str,
}

impl ChipProgram {
    /// The path of the file.
    pub(crate) fn path(&self) -> PathBuf {
        target_directory().join(CHIP).join(self.profile).join(self.name)
    }

    /// Reads the file.
    pub(crate) fn read(&self) -> TaskResult<Vec<u8>> {
        let path = self.path();
        fs::read(&path).map_err(|why| format!("cannot read {}: {why}", path.display()).into())
    }
}

/// The profile of `footprint` for size, and the one for speed.
pub(crate) const SMALL: &str = "chip";
pub(crate) const FAST: &str = "chip-fast";

/// The image for the arm.
pub(crate) const IMAGE: ChipProgram = ChipProgram { name: "firmware-stm32", profile: "firmware" };
/// The self-test image for the first power-up of a board.
pub(crate) const SELF_TEST: ChipProgram = ChipProgram { name: "self-test", profile: "firmware" };
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

/// Builds the image for the arm.
pub(crate) fn build_image() -> TaskResult {
    run("rustup", &format!("--quiet target add {CHIP}"), &[])?;
    cargo("fw --quiet")
}

/// Builds the simulator, with one of its tests: cargo then selects features as for all tests.
pub(crate) fn build_host_sim() -> TaskResult {
    cargo(&format!("test --quiet {TESTED} --test command_line --no-run"))
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

/// Cargo's target directory.
pub(crate) fn target_directory() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |set| root().join(set))
}
