//! The parts of the programs, the module, the page and the image as lists in the format CycloneDX, made by cargo-cyclonedx.

use std::fs;
use std::process::Command;

use super::platform::build_directory;
use super::release::Release;
use super::{sources, tools};
use crate::run::{TaskResult, run_command};

/// The packages that have a list: their folder, their name, and the name of the list.
const LISTED: [(&str, &str, &str); 5] = [
    ("sevenbot-cli", "sevenbot-cli", "sevenbot"),
    ("host-sim", "host-sim", "host-sim"),
    ("python", "sevenbot-python", "sevenbot-python"),
    ("web", "sevenbot-web", "sevenbot-page"),
    ("firmware-stm32", "firmware-stm32", "firmware-stm32"),
];

fn name(release: &Release, stem: &str) -> String {
    release.name(stem, ".cdx.json")
}

pub(super) fn names(release: &Release) -> Vec<String> {
    LISTED.iter().map(|(_, _, stem)| name(release, stem)).collect()
}

/// Writes the lists. The tool writes beside the manifests, so it gets a copy of the sources.
pub(super) fn write(release: &Release) -> TaskResult {
    let copy = build_directory().join("sources");
    sources::copy(&copy)?;
    let mut tool = Command::new(tools::cyclonedx()?);
    tool.args(["cyclonedx", "--format", "json", "--spec-version", "1.5", "--all", "--quiet"]);
    // Otherwise the parts for the chip, the browser and Windows are missing.
    tool.args(["--target", "all", "--no-build-deps"]);
    run_command(tool.env("SOURCE_DATE_EPOCH", release.epoch.to_string()).current_dir(&copy))?;
    for (folder, package, stem) in LISTED {
        let list = fs::read_to_string(copy.join(folder).join(format!("{package}.cdx.json")))?;
        let list = list.replace(&copy.display().to_string(), "/sevenbot");
        fs::write(release.path(&name(release, stem)), list)?;
    }
    Ok(())
}
