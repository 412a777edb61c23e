//! Makes all files of a release.

use std::fs;
use std::path::{Path, PathBuf};
use std::thread;

use rustix::fs::Mode;
use rustix::process::umask;

use super::archive::{PackedFile, tar_gz, zip};
use super::contents::{NOTE, archive_name, licences_name};
use super::platform::{PLATFORMS, Platform, host_platform};
use super::release::Release;
use super::tree::{self, CommonFiles};
use super::{check, debian, firmware, licences, page, sbom, sums, tools, wheels};
use crate::run::{TaskResult, empty_folder, target_directory};
use crate::times::Times;

/// Makes a release in `folder`, and checks it.
pub(super) fn make(folder: PathBuf) -> TaskResult {
    // Archives that other tools make keep the permissions of files, which depend on the umask.
    umask(Mode::from_raw_mode(0o022));
    let release = Release::of_this_commit(folder)?;
    empty_folder(&release.folder)?;
    println!("{}", release.text());
    timed("tools", || tools::python().map(drop))?;
    // Build cargo-cyclonedx beside the page, because linking uses only one processor.
    let cyclonedx = thread::spawn(|| tools::cyclonedx().map(drop).map_err(|why| why.to_string()));
    timed("page", || {
        page::build(&release)?;
        page::write(&release)
    })?;
    let native = host_platform()?;
    let mut built = Vec::new();
    for platform in PLATFORMS {
        timed(platform.name, || {
            built.push((platform, platform.build(&release)?));
            Ok(())
        })?;
    }
    let programs =
        built.iter().find(|(platform, _)| *platform == native).ok_or("no programs for this computer")?;
    let licences = licences::text()?;
    let common = CommonFiles::new(&programs.1.join("sevenbot"), &licences)?;
    for (platform, folder) in &built {
        pack(&release, *platform, folder, &common)?;
    }
    timed("Python packages", || wheels::write(&release))?;
    timed("firmware", || firmware::write(&release))?;
    cyclonedx.join().map_err(|_| "the build of cargo-cyclonedx panicked")??;
    timed("lists of parts", || sbom::write(&release))?;
    fs::write(release.path(&licences_name(&release)), licences)?;
    finish(&release)?;
    check::check(&release.folder, true)
}

/// Packs the programs that the tests have built for this computer: the archive and the package, in a folder of their own.
/// Makes no wheel, because the step of the Python package already installs one. Checks the folder, and returns it.
pub(super) fn make_native() -> TaskResult<PathBuf> {
    let folder = target_directory().join("dist-native");
    let release = Release { commit: None, ..Release::of_this_commit(folder)? };
    empty_folder(&release.folder)?;
    let built = target_directory().join("debug");
    let common = CommonFiles::new(&built.join("sevenbot"), &licences::text()?)?;
    pack(&release, host_platform()?, &built, &common)?;
    finish(&release)?;
    check::check(&release.folder, false)?;
    Ok(release.folder)
}

/// Writes the archive of a system, and for Linux the package.
fn pack(release: &Release, platform: Platform, built: &Path, common: &CommonFiles) -> TaskResult {
    let files = tree::files(platform, built, common)?;
    let folder = release.name("sevenbot", &format!("-{}", platform.name));
    let below: Vec<PackedFile> = files.iter().map(|file| file.below(&folder)).collect();
    let bytes = if platform.debian.is_some() { tar_gz(&below, release.epoch)? } else { zip(&below)? };
    fs::write(release.path(&archive_name(release, platform)), bytes)?;
    debian::write(release, platform, &files)
}

/// Writes the note, and then the sums of all files.
fn finish(release: &Release) -> TaskResult {
    fs::write(release.path(NOTE), release.note())?;
    sums::write(&release.folder)
}

/// Does a part, and prints how long it took.
fn timed(what: &str, part: impl FnOnce() -> TaskResult) -> TaskResult {
    let (times, outcome) = Times::of(part);
    println!("{what}: {times}");
    outcome.map_err(|why| format!("{what}: {why}").into())
}
