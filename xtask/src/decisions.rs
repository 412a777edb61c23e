//! The table in docs/protocol.md that says which tests hold each decision, D1 to D20: made from the tests' names.
//!
//! A test that holds D3 and D4 is called `d03_d04_...`. Knows nothing of what a decision says.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crate::generated::Section;
use crate::run::{Outcome, root};

/// The decisions there are.
const DECISIONS: std::ops::RangeInclusive<u8> = 1..=20;
const SECTION: Section = Section {
    document: "docs/protocol.md",
    begin: "<!-- begin: made by `cargo xtask docs` from the names of the tests -->\n",
};

/// Writes the table.
pub(crate) fn write() -> Outcome {
    SECTION.write(&table()?)
}

/// Fails if the table is stale, or if a decision has no test.
pub(crate) fn check() -> Outcome {
    SECTION.check(&table()?)
}

fn table() -> Outcome<String> {
    let mut tests: BTreeMap<u8, Vec<String>> = BTreeMap::new();
    let mut files = Vec::new();
    find_sources(root(), &mut files)?;
    files.sort();
    for file in files {
        let source = fs::read_to_string(&file)?;
        let place = file.strip_prefix(root())?.display().to_string();
        for (name, decision) in source.lines().filter_map(test_name).flat_map(decisions) {
            tests.entry(decision).or_default().push(format!("`{place}`: {name}"));
        }
    }
    let mut table = String::from("| decision | held by |\n| --- | --- |\n");
    for decision in DECISIONS {
        let tests = tests
            .get(&decision)
            .ok_or_else(|| format!("no test holds D{decision}: name one d{decision:02}_"))?;
        writeln!(table, "| D{decision} | {} |", tests.join("<br>"))?;
    }
    Ok(table)
}

/// All Rust files of the project below `folder`.
fn find_sources(folder: &Path, files: &mut Vec<PathBuf>) -> Outcome {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            find_sources(&path, files)?;
        } else if name.ends_with(".rs") {
            files.push(path);
        }
    }
    Ok(())
}

/// The name in a line that begins a function named after decisions.
fn test_name(line: &str) -> Option<&str> {
    let name = line.trim_start().strip_prefix("fn ")?.split('(').next()?;
    number(name).map(|_| name)
}

/// The decisions a test's name begins with, each with the rest of the name in words.
fn decisions(name: &str) -> Vec<(String, u8)> {
    let mut numbers = Vec::new();
    let mut rest = name;
    while let Some(decision) = number(rest) {
        numbers.push(decision);
        rest = rest.get(4..).unwrap_or_default();
    }
    numbers.into_iter().map(|decision| (rest.replace('_', " "), decision)).collect()
}

/// The number in a beginning like `d07_`.
fn number(name: &str) -> Option<u8> {
    let (digits, _) = name.strip_prefix('d')?.split_once('_')?;
    (digits.len() == 2).then(|| digits.parse().ok())?
}
