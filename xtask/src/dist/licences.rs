//! The licences of the crates of crates.io in a release, and of Blockly, with the texts that their packages hold.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crate::blockly;
use crate::run::TaskResult;
use crate::workspace::{Metadata, Package, metadata};

/// The packages whose programs, module, page and image are released.
const RELEASED: [&str; 5] = ["firmware-stm32", "host-sim", "sevenbot-cli", "sevenbot-python", "sevenbot-web"];
/// How the names of files with a licence begin.
const LICENCE_FILES: [&str; 6] = ["copying", "copyright", "licence", "license", "notice", "unlicense"];
/// The line between two parts of the text.
const RULE: &str = "\n================================================================================\n";

/// The list of these crates and Blockly, and each text of a licence once.
pub(super) fn text() -> TaskResult<String> {
    let Metadata { packages, resolve } = metadata(&["--locked"])?;
    let is_released = |package: &&Package| RELEASED.contains(&package.name.as_str());
    let released = packages.iter().filter(is_released).map(|package| package.id.as_str()).collect();
    let resolve = resolve.ok_or("`cargo metadata` does not say which packages each package uses")?;
    let part = resolve.parts(released);
    let mut crates: Vec<_> = packages
        .iter()
        .filter(|package| package.source.is_some() && part.contains(package.id.as_str()))
        .collect();
    crates.sort_by(|one, other| (&one.name, &one.version).cmp(&(&other.name, &other.version)));
    let mut text =
        "The programs, the Python module, the page and the image contain these packages of crates.io, and the page contains\n\
         Blockly. The texts of their licences follow the list.\n\n"
            .to_owned();
    let mut licences: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for package in crates {
        let name = format!("{} {}", package.name, package.version);
        writeln!(text, "{name}: {}", package.license.as_deref().unwrap_or("see its text"))?;
        for licence in texts(package)? {
            licences.entry(licence).or_default().push(name.clone());
        }
    }
    writeln!(text, "{}", blockly::NAME)?;
    licences.entry(blockly::licence()?).or_default().push(blockly::NAME.to_owned());
    let mut licences: Vec<_> = licences.into_iter().collect();
    licences.sort_by(|(_, one), (_, other)| one.cmp(other));
    for (licence, names) in licences {
        write!(text, "{RULE}{}\n\n{}\n", names.join(", "), licence.trim())?;
    }
    Ok(text)
}

/// The texts of the licences that a package holds.
fn texts(package: &Package) -> TaskResult<Vec<String>> {
    let folder = package.manifest_path.parent().unwrap_or(Path::new(""));
    let mut paths: Vec<_> = fs::read_dir(folder)?.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| path.is_file() && is_licence(path));
    paths.sort();
    let text = |path: &PathBuf| Ok(String::from_utf8_lossy(&fs::read(path)?).replace("\r\n", "\n"));
    paths.iter().map(text).collect()
}

fn is_licence(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    LICENCE_FILES.iter().any(|start| name.starts_with(start))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    #[test]
    fn a_crate_of_the_programs_is_listed_and_one_of_the_tests_is_not() {
        let text = text().unwrap();
        for wanted in
            ["\nclap 4.", "\nserialport 4.", "\nrustls 0.", "\ncortex-m 0.", "Mozilla Public License"]
        {
            assert!(text.contains(wanted), "{wanted}");
        }
        for unwanted in ["\nproptest ", "\ninsta ", "\nsevenbot "] {
            assert!(!text.contains(unwanted), "{unwanted}");
        }
    }
}
