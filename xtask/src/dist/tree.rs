//! The files of an installation: on Linux, below `/usr`, `/usr/local` or `~/.local`.
//!
//! ```text
//!   bin/                             sevenbot, host-sim
//!   lib/udev/rules.d/                names and rights of the ports
//!   share/man/man1/                  the manual pages
//!   share/bash-completion, zsh, fish the completions
//!   share/doc/sevenbot/              README, changes, licences
//! ```

use std::fs;
use std::path::Path;
use std::process::Command;

use clap::CommandFactory;
use clap_mangen::Man;
use host_sim::cli::Options;

use super::archive::PackedFile;
use super::platform::{Platform, build_directory, read_program};
use crate::run::{TaskResult, empty_folder, root, run_command};

/// Gives the arm and its adapter stable names, and the group `dialout` the right to open them.
pub(super) const UDEV_RULE: &str = "lib/udev/rules.d/70-sevenbot.rules";
/// Where the README, the licences and the changes are.
pub(super) const DOC: &str = "share/doc/sevenbot";
/// The README for users who install the programs from an archive.
const README: &str = include_str!("../../../packaging/README.txt");

/// Completions: the name of a shell, and its file.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "share/bash-completion/completions/sevenbot"),
    ("fish", "share/fish/vendor_completions.d/sevenbot.fish"),
    ("zsh", "share/zsh/vendor-completions/_sevenbot"),
];

/// The files of an installation that are not programs. They do not depend on the processor.
pub(super) struct CommonFiles {
    /// The README, the licences and the changes.
    pub(super) documents: Vec<PackedFile>,
    /// For Linux only: the manual pages, the completions and the udev rule.
    pub(super) linux: Vec<PackedFile>,
}

impl CommonFiles {
    /// `program`: a `sevenbot` that runs on this computer. `licences`: the licences of the parts that others wrote.
    pub(super) fn new(program: &Path, licences: &str) -> TaskResult<Self> {
        let mut linux = man_pages(program)?;
        for (shell, path) in COMPLETIONS {
            linux.push(PackedFile::text(path, output(program, &["completions", shell])?));
        }
        linux.push(PackedFile::text(UDEV_RULE, fs::read(root().join("packaging/70-sevenbot.rules"))?));
        Ok(Self { documents: documents(licences)?, linux })
    }
}

/// The archive's files for a system: on Windows, everything in one folder.
pub(super) fn files(platform: Platform, built: &Path, common: &CommonFiles) -> TaskResult<Vec<PackedFile>> {
    let folder = if platform.debian.is_some() { "bin/" } else { "" };
    let mut files = Vec::new();
    for name in platform.programs() {
        files.push(PackedFile::program(format!("{folder}{name}"), read_program(built, name)?));
    }
    if platform.debian.is_some() {
        files.extend(common.linux.iter().cloned());
        files.extend(common.documents.iter().map(|file| file.below(DOC)));
    } else {
        files.extend(common.documents.iter().cloned());
    }
    Ok(files)
}

fn documents(licences: &str) -> TaskResult<Vec<PackedFile>> {
    let mut files =
        vec![PackedFile::text("README.txt", README), PackedFile::text("THIRD-PARTY-LICENCES.txt", licences)];
    for name in ["CHANGELOG.md", "LICENSE-APACHE", "LICENSE-MIT"] {
        files.push(PackedFile::text(name, fs::read(root().join(name))?));
    }
    Ok(files)
}

/// The manual pages of `sevenbot`, which writes them itself, and of `host-sim`.
fn man_pages(program: &Path) -> TaskResult<Vec<PackedFile>> {
    let folder = build_directory().join("man");
    empty_folder(&folder)?;
    run_command(Command::new(program).args(["man", "--dir"]).arg(&folder))?;
    let mut page = Vec::new();
    Man::new(Options::command().name("host-sim")).render(&mut page)?;
    let mut pages = vec![PackedFile::text("share/man/man1/host-sim.1", page)];
    for entry in fs::read_dir(&folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        pages.push(PackedFile::text(format!("share/man/man1/{name}"), fs::read(&path)?));
    }
    Ok(pages)
}

fn output(program: &Path, arguments: &[&str]) -> TaskResult<Vec<u8>> {
    let output = Command::new(program).args(arguments).output()?;
    if output.status.success() {
        Ok(output.stdout)
    } else {
        Err(format!("{program:?} {arguments:?} failed").into())
    }
}
