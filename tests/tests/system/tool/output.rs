//! The output and the exit status of the command line tool.

use std::process::Output;

use system_tests::TestArm;
use system_tests::programs::tool;
use system_tests::registers::FAULTS;

/// The fault bit of the settings storage.
const SETTINGS_STORAGE: u8 = 1 << 0;

/// The standard output of a command that succeeded.
#[track_caller]
pub(crate) fn succeeded(output: Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", all_output(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// Runs a command that writes settings, and returns its output. The emulator has no storage for settings: then the command
/// has to report this.
#[track_caller]
pub(crate) fn stored(arm: &mut TestArm, arguments: &[&str]) -> String {
    let output = arm.sevenbot(arguments);
    if arm.register(FAULTS) & SETTINGS_STORAGE == 0 {
        return succeeded(output);
    }
    let text = failed(&output, 1);
    assert!(
        text.contains("may be lost when the arm is switched off: the settings storage has a fault"),
        "{text}"
    );
    text
}

/// The whole output of a command that ended with this status.
#[track_caller]
pub(crate) fn failed(output: &Output, status: i32) -> String {
    let text = all_output(output);
    assert_eq!(output.status.code(), Some(status), "{text}");
    assert!(!text.contains("panicked"), "{text}");
    text
}

/// Standard output and standard error of a command.
pub(crate) fn all_output(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat()
}

/// The words of the line that begins with `first`.
#[track_caller]
pub(crate) fn words<'a>(text: &'a str, first: &str) -> Vec<&'a str> {
    let line = text.lines().find(|line| line.trim_start().starts_with(first));
    line.unwrap_or_else(|| panic!("no line with {first} in:\n{text}")).split_whitespace().collect()
}

/// Runs the tool without a port, unless the arguments name one, and without the simulators of other tests.
pub(crate) fn run_without_arm(arguments: &[&str]) -> Output {
    let mut tool = tool();
    tool.args(arguments).env_remove("SEVENBOT_PORT").env("XDG_RUNTIME_DIR", "/dev/null");
    tool.output().expect("sevenbot runs")
}
