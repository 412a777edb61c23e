//! `cargo xtask modules`: no files of a crate depend on each other in a cycle.
//!
//! ```text
//!   source.rs  ──▶  tree.rs  ──▶  cycles.rs
//!   (paths in       (which file    (files that reach
//!    one file)       a path means)  each other)
//! ```
//!
//! Tests and comments do not count. A cycle that is listed below with its reason is allowed.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::run::Outcome;
use crate::workspace;

mod cycles;
mod source;
mod tree;

/// A cycle that is allowed.
struct Allowed {
    /// The folder of the crate.
    folder: &'static str,
    /// The files, from the folder `src`.
    files: &'static [&'static str],
    /// Why they depend on each other.
    reason: &'static str,
}

/// The allowed cycles, each with its files in alphabetical order. A cycle that is gone has to be removed.
const ALLOWED: &[Allowed] = &[
    Allowed {
        folder: "sevenbot",
        files: &["arm.rs", "ports.rs"],
        reason: "the search for ports opens an arm, and an arm without a port searches",
    },
    Allowed {
        folder: "sevenbot-cli",
        files: &["cli.rs", "commands/shell.rs"],
        reason: "the command `shell` parses command lines",
    },
    Allowed {
        folder: "sevenbot-cli",
        files: &[
            "commands/servo/center.rs",
            "commands/servo/info.rs",
            "commands/servo/mod.rs",
            "commands/servo/scan.rs",
            "commands/servo/set_id.rs",
            "commands/servo/torque_codes.rs",
        ],
        reason: "the subcommands use the options and the port that are in mod.rs",
    },
    Allowed {
        folder: "sevenbot-cli",
        files: &["failure.rs", "output.rs"],
        reason: "a failure is printed by the output, whose errors are failures",
    },
];

/// Checks every crate of the workspace.
pub(crate) fn check() -> Outcome {
    let mut faults = Vec::new();
    let mut found = BTreeSet::new();
    let mut files = 0;
    for package in workspace::packages()? {
        for source in package.roots() {
            let tree = tree::Tree::read(&source)?;
            files += tree.files();
            let folder = package.folder()?;
            for cycle in cycles::find(&tree.uses()) {
                match allowed(&folder, &source, &cycle) {
                    Some(allowed) => found.extend([allowed.files]),
                    None => faults.push(line(&folder, &source, &cycle)),
                }
            }
        }
    }
    let is_gone = |allowed: &&Allowed| !found.contains(&allowed.files);
    for allowed in ALLOWED.iter().filter(is_gone) {
        faults.push(format!(
            "{}: {} is gone; remove it from the list",
            allowed.folder,
            allowed.files.join(", ")
        ));
    }
    if faults.is_empty() {
        println!("{files} files: no cycle between files of a crate but the {} allowed", ALLOWED.len());
        return Ok(());
    }
    Err(format!("files depend on each other in a cycle:\n{}", faults.join("\n")).into())
}

/// The entry of the list that allows a cycle.
fn allowed(folder: &Path, root_file: &Path, cycle: &BTreeSet<PathBuf>) -> Option<&'static Allowed> {
    let names = names(root_file, cycle);
    let is_listed =
        |allowed: &&Allowed| folder == Path::new(allowed.folder) && names.iter().eq(allowed.files);
    let allowed = ALLOWED.iter().find(is_listed)?;
    println!("allowed in {}: {} ({})", allowed.folder, allowed.files.join(", "), allowed.reason);
    Some(allowed)
}

/// A line about a cycle that is not allowed.
fn line(folder: &Path, root_file: &Path, cycle: &BTreeSet<PathBuf>) -> String {
    format!("{}: {}", folder.display(), names(root_file, cycle).join(", "))
}

/// The files of a cycle, from the folder `src`, in alphabetical order.
fn names(root_file: &Path, cycle: &BTreeSet<PathBuf>) -> Vec<String> {
    let source = root_file.parent().unwrap_or(root_file);
    let names = cycle.iter().map(|file| file.strip_prefix(source).unwrap_or(file));
    let mut names: Vec<_> = names.map(|name| name.display().to_string()).collect();
    names.sort_unstable();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_is_allowed_only_with_all_its_files() {
        let root = Path::new("sevenbot-cli/src/main.rs");
        let cycle =
            |names: &[&str]| names.iter().map(|name| Path::new("sevenbot-cli/src").join(name)).collect();
        let listed = |cycle: &BTreeSet<PathBuf>| allowed(Path::new("sevenbot-cli"), root, cycle).is_some();
        for Allowed { files, .. } in ALLOWED.iter().filter(|allowed| allowed.folder == "sevenbot-cli") {
            assert!(listed(&cycle(files)), "{files:?}");
            assert!(!listed(&cycle(&[files, &["another.rs"][..]].concat())), "{files:?}");
        }
    }
}
