//! Installs parts of a release as its users do, and uses them.
//!
//! ```text
//!   archive, .deb, wheel ──▶ a bare Debian: no compiler, no Rust
//!   wheels               ──▶ each Python on this computer; aarch64 in qemu
//!   sevenbot.exe         ──▶ Wine
//!   page                 ──▶ Chromium, from the disk and from a web server
//! ```

mod bare_root;
mod emulated;
mod installed;
mod page;
mod wine;

use std::path::Path;
use std::process::Command;

use super::check::{self, noted};
use super::firmware;
use super::make::{make, make_native};
use crate::install;
use crate::run::{TaskResult, run_command, target_directory};

/// Makes the part of a release for this computer from the programs that the tests built, and tries it.
pub(crate) fn native() -> TaskResult {
    install::for_release()?;
    let folder = make_native()?;
    installed::programs(&noted(&folder)?)
}

/// Makes a whole release, and tries it.
pub(crate) fn whole() -> TaskResult {
    let folder = target_directory().join("dist-whole");
    make(folder.clone())?;
    parts(&folder)
}

/// Tries a finished release: the programs, the packages, the module's wheels, the page and the `.dfu` file.
pub(super) fn parts(folder: &Path) -> TaskResult {
    install::for_release()?;
    check::check(folder, true)?;
    let release = noted(folder)?;
    installed::packages_are_flawless(&release)?;
    installed::programs(&release)?;
    installed::wheels(&release)?;
    emulated::aarch64(&release)?;
    wine::programs(&release)?;
    page::both(&release)?;
    run_command(Command::new("dfu-suffix").arg("--check").arg(release.path(&firmware::dfu_name(&release))))
}
