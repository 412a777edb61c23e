//! The crates of the workspace and their dependencies, as `cargo metadata` reports them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Deserialize;

use crate::run::{TaskResult, root};

/// The part of the metadata that is read here.
#[derive(Deserialize)]
pub(crate) struct Metadata {
    pub(crate) packages: Vec<Package>,
    /// Which packages each package uses. `None` with `--no-deps`.
    pub(crate) resolve: Option<Resolve>,
}

#[derive(Clone, Default, Deserialize)]
pub(crate) struct Package {
    pub(crate) id: String,
    pub(crate) name: String,
    pub(crate) version: String,
    pub(crate) license: Option<String>,
    /// `None` for a package of this repository.
    pub(crate) source: Option<String>,
    pub(crate) manifest_path: PathBuf,
    pub(crate) targets: Vec<CrateTarget>,
    pub(crate) dependencies: Vec<Dependency>,
}

#[derive(Clone, Deserialize)]
pub(crate) struct CrateTarget {
    kind: Vec<String>,
    src_path: PathBuf,
}

/// A dependency, as a manifest names it.
#[derive(Clone, Default, Deserialize)]
pub(crate) struct Dependency {
    pub(crate) name: String,
    /// The versions that it may have.
    pub(crate) req: String,
    /// `dev`, `build`, or `None` for a normal dependency.
    pub(crate) kind: Option<String>,
    /// The folder, if the dependency is a crate of the workspace.
    pub(crate) path: Option<PathBuf>,
}

/// Which packages each package uses.
#[derive(Deserialize)]
pub(crate) struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<NodeDependency>,
}

#[derive(Deserialize)]
struct NodeDependency {
    pkg: String,
    dep_kinds: Vec<DependencyKind>,
}

#[derive(Deserialize)]
struct DependencyKind {
    /// `dev`, `build`, or `None` for a normal dependency.
    kind: Option<String>,
}

/// The report of `cargo metadata` with these arguments.
pub(crate) fn metadata(arguments: &[&str]) -> TaskResult<Metadata> {
    let mut cargo = Command::new("cargo");
    cargo.args(["metadata", "--format-version", "1"]).args(arguments).current_dir(root());
    let output = cargo.stderr(Stdio::inherit()).output()?;
    if !output.status.success() {
        Err(format!("`cargo metadata {}` failed", arguments.join(" ")))?;
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// The crates of the workspace, in the order of their names.
pub(crate) fn packages() -> TaskResult<Vec<Package>> {
    let mut packages = metadata(&["--no-deps"])?.packages;
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

    /// The crates of the workspace that it depends on, without those that only its build or its tests use.
    pub(crate) fn uses(&self) -> BTreeSet<&str> {
        let is_normal = |dependency: &&Dependency| dependency.kind.is_none() && dependency.path.is_some();
        self.dependencies.iter().filter(is_normal).map(|dependency| dependency.name.as_str()).collect()
    }
}

impl Resolve {
    /// The ids of these packages and of their direct and indirect dependencies, without build and test dependencies.
    pub(crate) fn parts<'a>(&'a self, mut open: Vec<&'a str>) -> BTreeSet<&'a str> {
        let mut found = BTreeSet::new();
        while let Some(id) = open.pop() {
            let node = self.nodes.iter().find(|node| node.id == id);
            let Some(node) = node.filter(|_| found.insert(id)) else { continue };
            let is_part = |on: &&NodeDependency| on.dep_kinds.iter().any(|kind| kind.kind.is_none());
            open.extend(node.deps.iter().filter(is_part).map(|on| on.pkg.as_str()));
        }
        found
    }
}
