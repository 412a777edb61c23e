//! Checks a finished folder: its files are listed and unchanged, and programs and packages have the version that its note names.

use std::fs;
use std::io::{Cursor, Read};
use std::path::Path;
use std::process::Command;

use flate2::read::GzDecoder;
use zip::ZipArchive;

use super::contents::{NOTE, names};
use super::release::Release;
use super::sums;
use crate::run::TaskResult;

/// Checks a folder. With `all`, no file of a release may be missing.
pub(super) fn check(folder: &Path, all: bool) -> TaskResult {
    let release = noted(folder)?;
    let found = sums::check(folder)?;
    if all {
        let mut wanted = names(&release);
        wanted.sort();
        let missing: Vec<_> = wanted.iter().filter(|name| !found.contains(name)).cloned().collect();
        let unknown: Vec<_> = found.iter().filter(|name| !wanted.contains(name)).cloned().collect();
        if !(missing.is_empty() && unknown.is_empty()) {
            return Err(format!("missing: {missing:?}, not part of a release: {unknown:?}").into());
        }
    }
    for name in &found {
        check_file(&release, name).map_err(|why| format!("{name}: {why}"))?;
    }
    println!("{}: {} files of {} are complete and unchanged", folder.display(), found.len(), release.text());
    Ok(())
}

/// The release that the note in the folder describes.
pub(super) fn noted(folder: &Path) -> TaskResult<Release> {
    let path = folder.join(NOTE);
    let text = fs::read_to_string(&path).map_err(|why| format!("{}: {why}", path.display()))?;
    let value = |key: &str| {
        let found = text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(": "));
        found.map(str::to_owned).ok_or(format!("{NOTE} has no {key}"))
    };
    let commit =
        text.lines().any(|line| line.starts_with("commit: ")).then(|| value("commit")).transpose()?;
    Ok(Release {
        version: value("version")?,
        commit,
        epoch: value("time")?.parse()?,
        folder: folder.to_owned(),
    })
}

fn check_file(release: &Release, name: &str) -> TaskResult {
    let bytes = fs::read(release.path(name))?;
    match name.rsplit('.').next() {
        Some("gz") => check_programs(release, &unpacked_tar(&bytes)?),
        Some("zip" | "whl") => check_programs(release, &unpacked_zip(bytes)?),
        Some("deb") => check_deb(release, name),
        Some("json") => Ok(serde_json::from_slice::<serde_json::Value>(&bytes).map(drop)?),
        _ if bytes.is_empty() => Err("it is empty".into()),
        _ => Ok(()),
    }
}

/// Checks that each program, and the metadata of each wheel, contains the version of the release.
fn check_programs(release: &Release, files: &[(String, Vec<u8>)]) -> TaskResult {
    if files.is_empty() {
        return Err("it is empty".into());
    }
    let text = release.text();
    for (path, bytes) in files {
        if is_program(path, bytes) && !bytes.windows(text.len()).any(|window| window == text.as_bytes()) {
            return Err(format!("{path} is not of version {text}").into());
        }
        if path.ends_with(".dist-info/METADATA") {
            let line = format!("\nVersion: {}\n", release.version);
            if !String::from_utf8_lossy(bytes).replace('\r', "").contains(&line) {
                return Err(format!("{path} is not of version {}", release.version).into());
            }
        }
    }
    Ok(())
}

/// Is this a program? Completions for a shell have the same file name, so the first bytes decide.
fn is_program(path: &str, bytes: &[u8]) -> bool {
    let is_named = ["/sevenbot", "/sevenbot.exe", "/host-sim"].iter().any(|name| path.ends_with(name));
    is_named && (bytes.starts_with(b"\x7FELF") || bytes.starts_with(b"MZ"))
}

fn check_deb(release: &Release, name: &str) -> TaskResult {
    let output = Command::new("dpkg-deb").arg("--field").arg(release.path(name)).arg("Version").output()?;
    let version = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    if version == release.version { Ok(()) } else { Err(format!("it is of version {version:?}").into()) }
}

fn unpacked_tar(bytes: &[u8]) -> TaskResult<Vec<(String, Vec<u8>)>> {
    let mut files = Vec::new();
    for entry in tar::Archive::new(GzDecoder::new(bytes)).entries()? {
        let mut entry = entry?;
        let mut content = Vec::new();
        entry.read_to_end(&mut content)?;
        files.push((entry.path()?.display().to_string(), content));
    }
    Ok(files)
}

fn unpacked_zip(bytes: Vec<u8>) -> TaskResult<Vec<(String, Vec<u8>)>> {
    let mut archive = ZipArchive::new(Cursor::new(bytes))?;
    let mut files = Vec::new();
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index)?;
        let mut content = Vec::new();
        entry.read_to_end(&mut content)?;
        files.push((entry.name()?.into_owned(), content));
    }
    Ok(files)
}
