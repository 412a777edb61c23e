//! Running the programs the chores are made of. Knows no chore.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::{env, fs};

/// What a chore comes to: a failure says what to do about it.
pub(crate) type Outcome<T = ()> = Result<T, Box<dyn Error>>;

/// The target of the chip.
pub(crate) const CHIP: &str = "thumbv7em-none-eabihf";
/// The target of a browser.
const BROWSER: &str = "wasm32-unknown-unknown";

/// Every package that builds for the host as a whole. All commands that build for the host choose the same packages: another
/// choice may mean other features, and then a second build of much of it.
pub(crate) const HOST: &str = "--workspace --exclude footprint --exclude firmware-stm32";

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

/// A program that ends when this is dropped.
pub(crate) struct Running(pub(crate) Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Errors mean that it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A program that is linked for the chip.
pub(crate) struct Linked {
    /// Its name.
    pub(crate) name: &'static str,
    /// The profile it is built with.
    pub(crate) profile: &'static str,
}

impl Linked {
    /// Where the file is.
    pub(crate) fn path(&self) -> PathBuf {
        target_directory().join(CHIP).join(self.profile).join(self.name)
    }

    /// Reads the file.
    pub(crate) fn read(&self) -> Outcome<Vec<u8>> {
        let path = self.path();
        fs::read(&path).map_err(|why| format!("cannot read {}: {why}", path.display()).into())
    }
}

/// The profile of `footprint`, and the same for speed instead of size.
pub(crate) const SMALL: &str = "chip";
/// See above.
pub(crate) const FAST: &str = "chip-fast";

/// The image for the arm.
pub(crate) const IMAGE: Linked = Linked { name: "firmware-stm32", profile: "firmware" };
/// The image for the first power-up of a board.
pub(crate) const SELF_TEST: Linked = Linked { name: "self-test", profile: "firmware" };
/// From bytes to reply, and nothing else.
pub(crate) const ANSWER: Linked = Linked { name: "answer", profile: SMALL };

/// The programs of `footprint` that are a part of the cores each, and the image.
const LINKED: &[Linked] = &[
    ANSWER,
    Linked { name: "arm", profile: SMALL },
    Linked { name: "journal", profile: SMALL },
    Linked { name: "unused_by_arm_motion", profile: SMALL },
    Linked { name: "unused_by_arm_protocol", profile: SMALL },
    IMAGE,
];

/// Links the programs for the chip.
pub(crate) fn link() -> Outcome<&'static [Linked]> {
    build_image()?;
    build_footprint(SMALL)?;
    Ok(LINKED)
}

/// Builds the image for the arm.
pub(crate) fn build_image() -> Outcome {
    run("rustup", &format!("--quiet target add {CHIP}"), &[])?;
    cargo("fw --quiet")
}

/// Builds the simulated arm for a browser, where there is no operating system.
pub(crate) fn build_for_browser() -> Outcome {
    run("rustup", &format!("--quiet target add {BROWSER}"), &[])?;
    cargo(&format!("build --package arm-sim --target {BROWSER}"))
}

/// Builds the programs of `footprint` with a profile.
pub(crate) fn build_footprint(profile: &str) -> Outcome {
    cargo(&format!("build --quiet --package footprint --target {CHIP} --profile {profile}"))
}

/// Where cargo puts what it builds.
pub(crate) fn target_directory() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |set| root().join(set))
}
