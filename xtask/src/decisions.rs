//! Generates the table in docs/protocol.md that lists the tests of each decision: D1 to D29, M1 to M10 and M12. The names of the
//! tests name the decisions.
//!
//! A test of D3 and M4 has a name like `d03_m04_...`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crate::generated::{self, GeneratedFile};
use crate::run::{TaskResult, root};

/// The letter and the number of a decision.
type Decision = (char, u8);

/// The decisions about the arm. D30 and M11 are about the programs of the host.
fn all_decisions() -> impl Iterator<Item = Decision> {
    let of_map22 = (1..=29).map(|number| ('D', number));
    of_map22.chain((1..=10).chain([12]).map(|number| ('M', number)))
}

/// The line before the table.
const BEGIN: &str = "<!-- begin: made by `cargo xtask docs` from the names of the tests -->\n";

/// The document with the table. Fails if a decision has no test.
pub(crate) fn files() -> TaskResult<Vec<GeneratedFile>> {
    generated::with_section("docs/protocol.md", BEGIN, &table()?)
}

fn table() -> TaskResult<String> {
    let mut tests: BTreeMap<Decision, Vec<String>> = BTreeMap::new();
    let mut files = Vec::new();
    find_sources(root(), &mut files)?;
    files.sort();
    for file in files {
        let source = fs::read_to_string(&file)?;
        let file = file.strip_prefix(root())?.display().to_string();
        for (name, decision) in source.lines().filter_map(test_name).flat_map(decisions) {
            tests.entry(decision).or_default().push(format!("`{file}`: {name}"));
        }
    }
    let mut table = String::from("| decision | held by |\n| --- | --- |\n");
    for decision @ (letter, number) in all_decisions() {
        let small = letter.to_ascii_lowercase();
        let tests = tests
            .get(&decision)
            .ok_or_else(|| format!("no test holds {letter}{number}: name one {small}{number:02}_"))?;
        writeln!(table, "| {letter}{number} | {} |", tests.join("<br>"))?;
    }
    Ok(table)
}

/// All Rust files of the project below `folder`.
fn find_sources(folder: &Path, files: &mut Vec<PathBuf>) -> TaskResult {
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

/// The name of a test of decisions that is defined in this line.
fn test_name(line: &str) -> Option<&str> {
    let name = line.trim_start().strip_prefix("fn ")?.split('(').next()?;
    decision(name).map(|_| name)
}

/// The decisions in the name of a test, each with the rest of the name as text.
fn decisions(name: &str) -> Vec<(String, Decision)> {
    let mut decisions = Vec::new();
    let mut rest = name;
    while let Some(decision) = decision(rest) {
        decisions.push(decision);
        rest = rest.get(4..).unwrap_or_default();
    }
    decisions.into_iter().map(|decision| (rest.replace('_', " "), decision)).collect()
}

/// The decision of a prefix like `d07_` or `m07_`.
fn decision(name: &str) -> Option<Decision> {
    let (prefix, _) = name.split_once('_')?;
    let (letter, digits) = prefix.split_at_checked(1)?;
    let letter = letter.parse().ok().filter(|letter| matches!(letter, 'd' | 'm'))?;
    let number = (digits.len() == 2).then(|| digits.parse().ok())??;
    Some((letter.to_ascii_uppercase(), number))
}
