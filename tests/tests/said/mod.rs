//! What the command line tool said, and how it ended.

// Not every test asks for everything.
#![allow(dead_code)]

use std::process::Output;

use system_tests::programs::tool;

/// Standard output of a command that ended well.
#[track_caller]
pub(crate) fn done(output: Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// Everything a command said, for one that ended with this status.
#[track_caller]
pub(crate) fn failed(output: &Output, status: i32) -> String {
    let said = said(output);
    assert_eq!(output.status.code(), Some(status), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

/// Everything a command said.
pub(crate) fn said(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat()
}

/// The words of a line that begins with `first`.
#[track_caller]
pub(crate) fn words<'a>(text: &'a str, first: &str) -> Vec<&'a str> {
    let line = text.lines().find(|line| line.trim_start().starts_with(first));
    line.unwrap_or_else(|| panic!("no line with {first} in:\n{text}")).split_whitespace().collect()
}

/// The tool without an arm: none is named, and none is looked for.
pub(crate) fn without_arm(arguments: &[&str]) -> Output {
    tool().args(arguments).env_remove("SEVENBOT_PORT").output().expect("sevenbot runs")
}
