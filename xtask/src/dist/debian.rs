//! The package for Debian and Ubuntu: an installation below /usr, and the control files for `dpkg`.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use flate2::Compression;

use super::archive::{PackedFile, gzip};
use super::platform::{Platform, build_directory};
use super::release::Release;
use super::tree::DOC;
use crate::run::{TaskResult, empty_folder, run_command};

/// The maintainer of the package, unless the variables of Debian's tools name another one.
const MAINTAINER: &str = "7Bot V2 firmware developers <sevenbot@example.org>";
/// The package contains the text of the MIT licence. Each Debian system contains the text of the Apache licence.
const COPYRIGHT: &str = "\
Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: sevenbot
Comment: Contains packages of crates.io: see THIRD-PARTY-LICENCES.txt.gz beside this file.

Files: *
Copyright: 2026 the 7Bot V2 firmware developers
License: Expat or Apache-2.0

License: Expat
";
const APACHE: &str = "
License: Apache-2.0
 On Debian systems, the text of the Apache License, version 2.0, is in
 /usr/share/common-licenses/Apache-2.0.
";

/// The name of the package for a processor.
pub(super) fn name(release: &Release, debian: &str) -> String {
    format!("sevenbot_{}_{debian}.deb", release.version)
}

/// Writes the package with these files of an installation. Does nothing for a system that is not Linux.
pub(super) fn write(release: &Release, platform: Platform, files: &[PackedFile]) -> TaskResult {
    let Some(debian) = platform.debian else { return Ok(()) };
    let folder = build_directory().join("debian").join(debian);
    empty_folder(&folder)?;
    let files = in_debian(files, release)?;
    files.iter().try_for_each(|file| put(&folder, file))?;
    let control = control(release, debian, &files);
    for (name, text) in [("control", control), ("md5sums", md5sums(&folder)?)] {
        put(&folder, &PackedFile::text(format!("DEBIAN/{name}"), text))?;
    }
    // Only a package for users has to be small. The programs of the tests contain debug information, so xz would take long.
    let compressor = if release.commit.is_some() { "-Zxz" } else { "-Zgzip" };
    let mut dpkg = Command::new("dpkg-deb");
    dpkg.args(["--root-owner-group", "--build", compressor])
        .arg(&folder)
        .arg(release.path(&name(release, debian)));
    run_command(dpkg.env("SOURCE_DATE_EPOCH", release.epoch.to_string()).stdout(std::process::Stdio::null()))
}

/// The files as Debian's policy wants them: below /usr, manual pages and changes compressed as far as possible, one file with
/// the copyright.
fn in_debian(files: &[PackedFile], release: &Release) -> TaskResult<Vec<PackedFile>> {
    let mut found = Vec::new();
    for file in files {
        let name = file.path.rsplit('/').next().unwrap_or_default();
        let compressed =
            |path: String| TaskResult::Ok(PackedFile::text(path, gzip(&file.bytes, Compression::best())?));
        match name {
            "LICENSE-APACHE" | "README.txt" => {}
            "LICENSE-MIT" => {
                let text = copyright(&String::from_utf8_lossy(&file.bytes));
                found.push(PackedFile::text(format!("usr/{DOC}/copyright"), text));
            }
            "CHANGELOG.md" => {
                found.push(compressed(format!("usr/{DOC}/NEWS.gz"))?);
                found.push(PackedFile::text(
                    format!("usr/{DOC}/changelog.gz"),
                    gzip(changelog(release)?.as_bytes(), Compression::best())?,
                ));
            }
            "THIRD-PARTY-LICENCES.txt" => found.push(compressed(format!("usr/{}.gz", file.path))?),
            _ if file.path.contains("/man/") => found.push(compressed(format!("usr/{}.gz", file.path))?),
            _ => found.push(file.below("usr")),
        }
    }
    Ok(found)
}

fn copyright(mit: &str) -> String {
    let text =
        mit.split_once("\n\n").and_then(|(_, rest)| rest.split_once("\n\n")).map_or(mit, |(_, text)| text);
    let lines = text
        .trim()
        .lines()
        .map(|line| if line.is_empty() { " .\n".to_owned() } else { format!(" {line}\n") });
    format!("{COPYRIGHT}{}{APACHE}", lines.collect::<String>())
}

/// The changelog in Debian's format. It refers to NEWS.gz, which lists the changes.
fn changelog(release: &Release) -> TaskResult<String> {
    let date = Command::new("date").args(["-u", "-R", "-d", &format!("@{}", release.epoch)]).output()?;
    let date = String::from_utf8(date.stdout)?;
    let (version, maintainer) = (&release.version, maintainer());
    Ok(format!(
        "sevenbot ({version}) stable; urgency=medium\n\n  * Version {version}: see NEWS.gz.\n\n -- {maintainer}  {date}"
    ))
}

fn control(release: &Release, debian: &str, files: &[PackedFile]) -> String {
    let kib: usize = files.iter().map(|file| file.bytes.len().div_ceil(1024)).sum();
    let programs = files.iter().filter(|file| file.is_program);
    let glibc = programs.filter_map(|program| newest_glibc(&program.bytes)).max().unwrap_or((2, 17));
    let unwinds_by_libgcc = |file: &PackedFile| file.is_program && contains(&file.bytes, b"libgcc_s.so.1");
    let libgcc = if files.iter().any(unwinds_by_libgcc) { ", libgcc-s1" } else { "" };
    format!(
        "Package: sevenbot\nVersion: {}\nArchitecture: {debian}\nMaintainer: {}\nInstalled-Size: {kib}\n\
         Depends: libc6 (>= {}.{}){libgcc}\nSection: electronics\nPriority: optional\n\
         Description: programs for the robot arm 7Bot V2\n \
         `sevenbot` controls the arm over its serial port: poses, recordings, a monitor\n \
         in the terminal, a page in the browser, and one arm for many programs.\n \
         `host-sim` simulates an arm, or controls real servos behind a USB adapter.\n",
        release.version,
        maintainer(),
        glibc.0,
        glibc.1
    )
}

fn maintainer() -> String {
    match (std::env::var("DEBFULLNAME"), std::env::var("DEBEMAIL")) {
        (Ok(name), Ok(address)) => format!("{name} <{address}>"),
        _ => MAINTAINER.to_owned(),
    }
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

/// The newest version of the C library of which a program uses a symbol: `GLIBC_2.17`.
fn newest_glibc(program: &[u8]) -> Option<(u32, u32)> {
    const MARK: &[u8] = b"GLIBC_2.";
    let version = |(at, window): (usize, &[u8])| {
        let digits = program.get(at + MARK.len()..).filter(|_| window == MARK)?;
        let digits = digits.iter().take_while(|byte| byte.is_ascii_digit());
        let number = digits.fold(0_u32, |number, byte| number * 10 + u32::from(byte - b'0'));
        Some((2, number))
    };
    program.windows(MARK.len()).enumerate().filter_map(version).max()
}

fn md5sums(folder: &Path) -> TaskResult<String> {
    let output = Command::new("sh")
        .args(["-c", "find usr -type f | LC_ALL=C sort | xargs -d '\\n' md5sum"])
        .current_dir(folder)
        .output()?;
    Ok(String::from_utf8(output.stdout)?)
}

fn put(folder: &Path, file: &PackedFile) -> TaskResult {
    let path: PathBuf = folder.join(&file.path);
    let parent = path.parent().unwrap_or(folder);
    fs::create_dir_all(parent)?;
    for directory in parent.ancestors().take_while(|directory| directory.starts_with(folder)) {
        fs::set_permissions(directory, fs::Permissions::from_mode(0o755))?;
    }
    fs::write(&path, &file.bytes)?;
    Ok(fs::set_permissions(&path, fs::Permissions::from_mode(file.mode()))?)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    #[test]
    fn the_newest_version_of_the_c_library_counts() {
        assert_eq!(newest_glibc(b"..GLIBC_2.9\0GLIBC_2.17\0GLIBC_2.4\0"), Some((2, 17)));
        assert_eq!(newest_glibc(b"static"), None);
    }

    #[test]
    fn the_copyright_has_the_text_of_the_licence_without_its_head() {
        let text = copyright("MIT License\n\nCopyright (c) somebody\n\nPermission is\n\ngranted\n");
        assert!(
            text.contains("License: Expat\n Permission is\n .\n granted\n\nLicense: Apache-2.0\n"),
            "{text}"
        );
    }
}
