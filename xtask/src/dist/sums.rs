//! `SHA256SUMS`, in the format of the program `sha256sum`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::run::TaskResult;

pub(super) const NAME: &str = "SHA256SUMS";

/// Writes the file with the sums of all other files in the folder.
pub(super) fn write(folder: &Path) -> TaskResult {
    let lines: String = of_files(folder)?.iter().map(|(name, sum)| format!("{sum}  {name}\n")).collect();
    Ok(fs::write(folder.join(NAME), lines)?)
}

/// Fails unless the folder has exactly the files of the list, and each is unchanged. Returns the names.
pub(super) fn check(folder: &Path) -> TaskResult<Vec<String>> {
    let path = folder.join(NAME);
    let text = fs::read_to_string(&path).map_err(|why| format!("{}: {why}", path.display()))?;
    let lines = text.lines().filter_map(|line| line.split_once("  "));
    let listed: BTreeMap<_, _> = lines.map(|(sum, name)| (name.to_owned(), sum.to_owned())).collect();
    let found = of_files(folder)?;
    let mut wrong = Vec::new();
    for (name, sum) in &listed {
        match found.get(name) {
            None => wrong.push(format!("{name} is missing")),
            Some(other) if other != sum => wrong.push(format!("{name} was changed")),
            Some(_) => {}
        }
    }
    wrong.extend(
        found
            .keys()
            .filter(|name| !listed.contains_key(*name))
            .map(|name| format!("{name} is not in {NAME}")),
    );
    if wrong.is_empty() { Ok(listed.into_keys().collect()) } else { Err(wrong.join("\n").into()) }
}

fn of_files(folder: &Path) -> TaskResult<BTreeMap<String, String>> {
    let mut sums = BTreeMap::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name != NAME {
            sums.insert(name, sum(&fs::read(&path)?)?);
        }
    }
    Ok(sums)
}

fn sum(bytes: &[u8]) -> TaskResult<String> {
    let mut text = String::new();
    for byte in Sha256::digest(bytes) {
        write!(text, "{byte:02x}")?;
    }
    Ok(text)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    #[test]
    fn a_changed_a_missing_and_an_added_file_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        put("a", "abc");
        put("b", "");
        write(folder.path()).unwrap();
        let list = fs::read_to_string(folder.path().join(NAME)).unwrap();
        // The example of FIPS 180-2, section B.1.
        assert!(
            list.starts_with("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  a\n"),
            "{list}"
        );
        assert_eq!(check(folder.path()).unwrap(), ["a", "b"]);
        put("a", "abd");
        put("c", "");
        fs::remove_file(folder.path().join("b")).unwrap();
        let wrong = check(folder.path()).unwrap_err().to_string();
        assert_eq!(wrong, "a was changed\nb is missing\nc is not in SHA256SUMS");
    }
}
