//! The command line tool in a terminal: prompts, colours and progress bars.

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::process::{Command, Stdio};
use std::time::Duration;

use super::output::{failed, succeeded};
use serialport::{SerialPort, TTYPort};
use system_tests::process::RunningProgram;
use system_tests::programs;
use system_tests::registers::MOTOR_STATE;
use system_tests::wait::wait_for;
use system_tests::{TestArm, TestSetup, with_arm};

/// A pseudo-terminal: the side of the test, and the side of the program.
fn terminal() -> (TTYPort, TTYPort) {
    let (mut ours, theirs) = TTYPort::pair().expect("a pseudo-terminal");
    ours.set_timeout(Duration::from_millis(100)).expect("a timeout");
    (ours, theirs)
}

fn stdio(terminal: &TTYPort) -> Stdio {
    let name = terminal.name().expect("a name");
    Stdio::from(File::options().read(true).write(true).open(name).expect("the terminal"))
}

fn tool(arm: &mut TestArm, arguments: &[&str]) -> Command {
    let mut tool = programs::tool();
    tool.arg("--port").arg(arm.lend_port()).args(arguments).env_remove("NO_COLOR").env("TERM", "xterm");
    tool
}

/// Reads from the terminal until the text contains `expected`.
#[track_caller]
fn read_until(terminal: &mut TTYPort, expected: &str) -> String {
    let mut received = Vec::new();
    wait_for(expected, || {
        let mut chunk = [0; 256];
        match terminal.read(&mut chunk) {
            Ok(length) => received.extend(&chunk[..length]),
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            Err(error) => panic!("{error}"),
        }
        let text = String::from_utf8_lossy(&received).into_owned();
        if text.contains(expected) { Ok(text) } else { Err(text) }
    })
}

#[test]
fn the_state_forceless_needs_a_confirmation() {
    with_arm(TestSetup::any(), |arm| {
        for (answer, state) in [("\n", 1), ("no\n", 1), ("y\n", 2)] {
            let (mut ours, theirs) = terminal();
            let mut tool = tool(arm, &["state", "forceless"]);
            tool.stdin(stdio(&theirs)).stdout(Stdio::piped()).stderr(stdio(&theirs));
            let tool = RunningProgram::spawn(&mut tool);
            read_until(&mut ours, "[y/N]");
            ours.write_all(answer.as_bytes()).expect("the terminal takes an answer");
            let output = tool.output();
            if state == 2 {
                drop(succeeded(output))
            } else {
                drop(failed(&output, 1))
            }
            arm.reopen(115_200);
            assert_eq!(arm.register(MOTOR_STATE), state, "after {answer:?}");
        }
    });
}

#[test]
fn a_wait_shows_a_progress_bar() {
    with_arm(TestSetup::any(), |arm| {
        let (mut ours, theirs) = terminal();
        let arguments = ["pose", "130", "_", "_", "_", "_", "_", "_", "--speed", "10", "--wait"];
        let mut tool = tool(arm, &arguments);
        tool.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(stdio(&theirs));
        let tool = RunningProgram::spawn(&mut tool);
        read_until(&mut ours, "of 40 degrees");
        let positions = succeeded(tool.output());
        assert_eq!(positions.split_whitespace().count(), 7, "{positions}");
        arm.reopen(115_200);
    });
}

#[test]
fn output_in_a_terminal_has_colours() {
    with_arm(TestSetup::any(), |arm| {
        let (mut ours, theirs) = terminal();
        let mut info = RunningProgram::spawn(tool(arm, &["info"]).stdout(stdio(&theirs)));
        let text = read_until(&mut ours, "servo bus errors");
        assert!(text.contains("\x1b[32mnone"), "missing servos: none, in green: {text}");
        info.wait().expect("the tool ends");
        arm.reopen(115_200);
    });
}
