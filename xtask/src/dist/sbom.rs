//! The parts of the programs as CycloneDX, made by cargo-cyclonedx.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use super::platform::build_directory;
use super::release::Release;
use super::tools;
use crate::run::{TaskResult, root, run_command};

/// The packages that have a list: their folder, and the name of the list.
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

/// The names of the lists.
pub(super) fn names(release: &Release) -> Vec<String> {
    LISTED.iter().map(|(_, _, stem)| name(release, stem)).collect()
}

/// Writes the lists. The tool writes beside the manifests, so it gets a copy of the sources.
pub(super) fn write(release: &Release) -> TaskResult {
    let copy = build_directory().join("sources");
    if copy.exists() {
        fs::remove_dir_all(&copy)?;
    }
    fs::create_dir_all(&copy)?;
    copy_sources(&copy)?;
    let mut tool = Command::new(tools::cyclonedx()?);
    tool.args(["cyclonedx", "--format", "json", "--spec-version", "1.5", "--all", "--quiet"]);
    run_command(tool.env("SOURCE_DATE_EPOCH", release.epoch.to_string()).current_dir(&copy))?;
    for (folder, package, stem) in LISTED {
        let list = fs::read_to_string(copy.join(folder).join(format!("{package}.cdx.json")))?;
        let list = list.replace(&copy.display().to_string(), "/sevenbot");
        fs::write(release.path(&name(release, stem)), list)?;
    }
    Ok(())
}

/// What git knows of the folder, as it is now.
fn copy_sources(copy: &Path) -> TaskResult {
    let mut list = Command::new("git");
    let mut list = list.args(["ls-files", "-z"]).current_dir(root()).stdout(Stdio::piped()).spawn()?;
    let files = list.stdout.take().ok_or("git has no output")?;
    let mut pack = Command::new("tar");
    pack.args(["--create", "--null", "--files-from=-"])
        .current_dir(root())
        .stdin(files)
        .stdout(Stdio::piped());
    let mut pack = pack.spawn()?;
    let packed = pack.stdout.take().ok_or("tar has no output")?;
    run_command(Command::new("tar").args(["--extract", "--directory"]).arg(copy).stdin(packed))?;
    if list.wait()?.success() && pack.wait()?.success() {
        Ok(())
    } else {
        Err("the sources cannot be copied".into())
    }
}
