//! `cargo xtask modules`: no files of a crate depend on each other in a cycle.
//!
//! ```text
//!   source.rs  ──▶  tree.rs  ──▶  cycles.rs
//!   (paths in       (which file    (files that reach
//!    one file)       a path means)  each other)
//! ```
//!
//! Tests and comments do not count.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::run::TaskResult;
use crate::workspace;

mod cycles;
mod source;
mod tree;

/// Checks every crate of the workspace.
pub(crate) fn check() -> TaskResult {
    let mut faults = Vec::new();
    let mut files = 0;
    for package in workspace::packages()? {
        for source in package.roots() {
            let tree = tree::Tree::read(&source)?;
            files += tree.files();
            let folder = package.folder()?;
            faults.extend(cycles::find(&tree.uses()).iter().map(|cycle| line(&folder, &source, cycle)));
        }
    }
    if faults.is_empty() {
        println!("{files} files: no cycle between files of a crate");
        return Ok(());
    }
    Err(format!("files depend on each other in a cycle:\n{}", faults.join("\n")).into())
}

/// A line about a cycle: the folder of the crate, and the files, relative to the folder of `root_file`.
fn line(folder: &Path, root_file: &Path, cycle: &BTreeSet<PathBuf>) -> String {
    let source = root_file.parent().unwrap_or(root_file);
    let names = cycle.iter().map(|file| file.strip_prefix(source).unwrap_or(file));
    let names: Vec<_> = names.map(|name| name.display().to_string()).collect();
    format!("{}: {}", folder.display(), names.join(", "))
}
