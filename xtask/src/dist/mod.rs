//! `cargo xtask dist`: everything that a release consists of, in one folder.
//!
//! ```text
//!   page ──▶ sevenbot, host-sim ──▶ tree ──▶ archives, .deb
//!   wheels, firmware, licences, sbom ──▶ files ──▶ sums ──▶ check
//! ```
//!
//! The same commit gives the same bytes: all builds get the time of the commit, and no path of this computer.

mod archive;
mod check;
mod contents;
mod crates;
mod debian;
mod dfu;
mod firmware;
mod licences;
mod make;
mod other_systems;
mod page;
mod platform;
mod release;
mod sbom;
mod sources;
mod sums;
mod tools;
mod tree;
mod trial;
mod wheels;

use std::path::PathBuf;

use clap::Args;

pub(crate) use self::crates::build_from_archives;
pub(crate) use self::other_systems::lint_other_systems;
pub(crate) use self::trial::{native, whole};
use crate::run::{TaskResult, root};

/// What to make, to check or to try.
#[derive(Args)]
pub(crate) struct DistArgs {
    /// Where the release is put; a folder that exists is replaced
    #[arg(long, value_name = "FOLDER", default_value = "dist")]
    out: PathBuf,
    /// Make nothing; check that a finished folder is complete and unchanged
    #[arg(long)]
    check: bool,
    /// Make nothing; install each part of a finished folder as its users do, and use it (needs root and Debian)
    #[arg(long = "try", conflicts_with = "check")]
    is_trial: bool,
}

/// Makes, checks or tries a release.
pub(crate) fn run(options: &DistArgs) -> TaskResult {
    let folder = root().join(&options.out);
    match (options.check, options.is_trial) {
        (true, _) => check::check(&folder, true),
        (_, true) => trial::parts(&folder),
        _ => make::make(folder),
    }
}
