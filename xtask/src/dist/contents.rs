//! The files that a release has.

use super::platform::{PLATFORMS, Platform};
use super::release::Release;
use super::{debian, firmware, page, sbom, wheels};

/// The note with the version, the commit and the time of the release.
pub(super) const NOTE: &str = "RELEASE.txt";

/// The names of all files but the sums.
pub(super) fn names(release: &Release) -> Vec<String> {
    let archives = PLATFORMS.iter().map(|&platform| archive_name(release, platform));
    let packages = PLATFORMS.iter().filter_map(|platform| Some(debian::name(release, platform.debian?)));
    let single =
        [page::folder_name(release), page::file_name(release), licences_name(release), NOTE.to_owned()];
    let lists = [wheels::names(release), firmware::names(release), sbom::names(release)].concat();
    archives.chain(packages).chain(single).chain(lists).collect()
}

pub(super) fn archive_name(release: &Release, platform: Platform) -> String {
    let tail = if platform.debian.is_some() { "tar.gz" } else { "zip" };
    release.name("sevenbot", &format!("-{}.{tail}", platform.name))
}

/// The name of the file with the licences of the parts that others wrote.
pub(super) fn licences_name(release: &Release) -> String {
    release.name("sevenbot", "-licences.txt")
}
