//! The crates of the workspace and their dependencies, as `cargo metadata` reports them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Deserialize;

use crate::run::{TaskResult, root};

/// The part of the metadata that is read here.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

/// A crate.
#[derive(Deserialize)]
pub(crate) struct Package {
    /// Its name.
    pub(crate) name: String,
    manifest_path: PathBuf,
    targets: Vec<CrateTarget>,
    dependencies: Vec<Dependency>,
}

#[derive(Deserialize)]
struct CrateTarget {
    kind: Vec<String>,
    src_path: PathBuf,
}

#[derive(Deserialize)]
struct Dependency {
    name: String,
    /// `dev`, `build`, or `None` for a normal dependency.
    kind: Option<String>,
    /// The folder, if the dependency is a crate of the workspace.
    path: Option<PathBuf>,
}

/// The crates of the workspace, in the order of their names.
pub(crate) fn packages() -> TaskResult<Vec<Package>> {
    let mut cargo = Command::new("cargo");
    cargo.args(["metadata", "--no-deps", "--format-version", "1"]).current_dir(root());
    let output = cargo.stderr(Stdio::inherit()).output()?;
    if !output.status.success() {
        Err("`cargo metadata` failed")?;
    }
    let mut packages = serde_json::from_slice::<Metadata>(&output.stdout)?.packages;
    packages.sort_by(|one, other| one.name.cmp(&other.name));
    Ok(packages)
}

impl Package {
    /// Its folder, relative to the root of the workspace.
    pub(crate) fn folder(&self) -> TaskResult<PathBuf> {
        let folder = self.manifest_path.parent().unwrap_or(Path::new(""));
        Ok(folder.strip_prefix(root())?.to_owned())
    }

    /// The root files of its library, of whatever kind, and of its programs.
    pub(crate) fn roots(&self) -> Vec<PathBuf> {
        let is_other = |kind: &String| ["bench", "custom-build", "example", "test"].contains(&kind.as_str());
        let is_root = |target: &&CrateTarget| !target.kind.iter().any(is_other);
        self.targets.iter().filter(is_root).map(|target| target.src_path.clone()).collect()
    }

    /// The crates of the workspace that it depends on, without those of its tests.
    pub(crate) fn uses(&self) -> BTreeSet<&str> {
        let is_normal = |dependency: &&Dependency| dependency.kind.is_none() && dependency.path.is_some();
        self.dependencies.iter().filter(is_normal).map(|dependency| dependency.name.as_str()).collect()
    }
}
