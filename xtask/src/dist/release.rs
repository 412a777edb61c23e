//! Which release is made: its version, its commit and its time.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use crate::run::{TaskResult, root};

/// The number of hexadecimal digits of a commit in versions, as an option of git.
const COMMIT_DIGITS: &str = "--abbrev=12";

#[derive(Clone, Debug)]
pub(super) struct Release {
    /// The version of the workspace: `3.0.0`.
    pub(super) version: String,
    /// The commit, with `-dirty` if files differ from it; `None`: the programs were built without it.
    pub(super) commit: Option<String>,
    /// The time of the commit in seconds since 1970. It is the time of all packed files, except in a `.zip`.
    pub(super) epoch: u64,
    /// Where the release is put.
    pub(super) folder: PathBuf,
}

impl Release {
    /// The release of the commit that is checked out.
    pub(super) fn of_this_commit(folder: PathBuf) -> TaskResult<Self> {
        let commit = git(&["describe", "--always", "--dirty", "--exclude=*", COMMIT_DIGITS])?;
        let epoch = git(&["log", "-1", "--format=%ct"])?.parse()?;
        Ok(Self { version: env!("CARGO_PKG_VERSION").to_owned(), commit: Some(commit), epoch, folder })
    }

    /// The version that the programs and the image print: `3.0.0 (0123456789ab)`, or `3.0.0`.
    pub(super) fn text(&self) -> String {
        match &self.commit {
            Some(commit) => format!("{} ({commit})", self.version),
            None => self.version.clone(),
        }
    }

    /// The text of `RELEASE.txt`: version, commit and time, each a line `key: value`.
    pub(super) fn note(&self) -> String {
        let commit = self.commit.as_ref().map(|commit| format!("commit: {commit}\n")).unwrap_or_default();
        format!("version: {}\n{commit}time: {}\n", self.version, self.epoch)
    }

    /// The path of a file of the release.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The name of a file: `STEM-3.0.0TAIL`.
    pub(super) fn name(&self, stem: &str, tail: &str) -> String {
        format!("{stem}-{}{tail}", self.version)
    }
}

fn git(arguments: &[&str]) -> TaskResult<String> {
    let output = Command::new("git").args(arguments).current_dir(root()).stderr(Stdio::inherit()).output();
    let output = output.map_err(|why| format!("cannot start git: {why}"))?;
    if !output.status.success() {
        return Err(format!("`git {}` failed: a release is made of a commit", arguments.join(" ")).into());
    }
    Ok(String::from_utf8(output.stdout)?.trim().to_owned())
}
