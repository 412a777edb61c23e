//! The linked programs for the chip, and the paths at which Cargo puts them.

use std::path::{Path, PathBuf};
use std::{env, fs};

use crate::process::TaskResult;

/// The target triple of the chip.
pub const CHIP: &str = "thumbv7em-none-eabihf";
/// The root of the workspace, as an absolute path.
#[must_use]
pub fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap_or(here)
}

/// Cargo's target directory: `CARGO_TARGET_DIR`, relative to the workspace, or `target`.
#[must_use]
pub fn target_directory() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |set| root().join(set))
}

/// A linked program for the chip.
#[derive(Debug)]
pub struct ChipProgram {
    /// The name of its binary target.
    pub name: &'static str,
    /// Its build profile, which is also the name of its folder in the target directory.
    pub profile: &'static str,
}

impl ChipProgram {
    /// The path of the linked ELF file.
    #[must_use]
    pub fn path(&self) -> PathBuf {
        target_directory().join(CHIP).join(self.profile).join(self.name)
    }

    /// Reads the file.
    ///
    /// # Errors
    /// The file cannot be read, for example because the program is not built.
    pub fn read(&self) -> TaskResult<Vec<u8>> {
        let path = self.path();
        fs::read(&path).map_err(|why| format!("cannot read {}: {why}", path.display()).into())
    }
}

/// The image for the arm.
pub const IMAGE: ChipProgram = ChipProgram { name: "firmware-stm32", profile: "firmware" };
/// The self-test image for the first power-up of a board.
pub const SELF_TEST: ChipProgram = ChipProgram { name: "self-test", profile: "firmware" };
