//! The command line tool with a person in front of it: a terminal it asks, colours, and draws a bar on.

mod said;

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use said::{done, failed};
use serialport::{SerialPort, TTYPort};
use system_tests::line::PATIENCE;
use system_tests::programs;
use system_tests::registers::MOTOR_STATE;
use system_tests::{Bench, Setup, with_arm};

/// A terminal: our side of it, and the program's.
fn terminal() -> (TTYPort, TTYPort) {
    let (mut ours, theirs) = TTYPort::pair().expect("a pseudo-terminal");
    ours.set_timeout(Duration::from_millis(100)).expect("a time-out");
    (ours, theirs)
}

fn side_of(terminal: &TTYPort) -> Stdio {
    let name = terminal.name().expect("a name");
    Stdio::from(File::options().read(true).write(true).open(name).expect("the terminal"))
}

fn tool(arm: &mut Bench, arguments: &[&str]) -> Command {
    let mut tool = programs::tool();
    tool.arg("--port").arg(arm.lend_port()).args(arguments).env_remove("NO_COLOR").env("TERM", "xterm");
    tool
}

/// What comes to the terminal until `wanted` is part of it.
#[track_caller]
fn read_until(terminal: &mut TTYPort, wanted: &str) -> String {
    let mut came = Vec::new();
    let deadline = Instant::now() + PATIENCE;
    while !String::from_utf8_lossy(&came).contains(wanted) {
        assert!(Instant::now() < deadline, "no {wanted} in {:?}", String::from_utf8_lossy(&came));
        let mut chunk = [0; 256];
        match terminal.read(&mut chunk) {
            Ok(length) => came.extend(&chunk[..length]),
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            Err(error) => panic!("{error}"),
        }
    }
    String::from_utf8_lossy(&came).into_owned()
}

#[test]
fn the_arm_falls_only_after_a_yes() {
    with_arm(Setup::any(), |arm| {
        for (answer, state) in [("\n", 1), ("no\n", 1), ("y\n", 2)] {
            let (mut ours, theirs) = terminal();
            let asking = tool(arm, &["state", "forceless"])
                .stdin(side_of(&theirs))
                .stdout(Stdio::piped())
                .stderr(side_of(&theirs))
                .spawn()
                .expect("sevenbot runs");
            read_until(&mut ours, "[y/N]");
            ours.write_all(answer.as_bytes()).expect("the terminal takes an answer");
            let output = asking.wait_with_output().expect("it ends");
            if state == 2 {
                drop(done(output))
            } else {
                drop(failed(&output, 1))
            }
            arm.reopen(115_200);
            assert_eq!(arm.register(MOTOR_STATE), state, "after {answer:?}");
        }
    });
}

#[test]
fn a_wait_draws_a_bar_and_takes_it_away() {
    with_arm(Setup::any(), |arm| {
        let (mut ours, theirs) = terminal();
        let waiting = tool(arm, &["pose", "130", "_", "_", "_", "_", "_", "_", "--speed", "10", "--wait"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(side_of(&theirs))
            .spawn()
            .expect("sevenbot runs");
        read_until(&mut ours, "of 40 degrees");
        let positions = done(waiting.wait_with_output().expect("it ends"));
        assert_eq!(positions.split_whitespace().count(), 7, "{positions}");
        arm.reopen(115_200);
    });
}

#[test]
fn a_terminal_gets_colours() {
    with_arm(Setup::any(), |arm| {
        let (mut ours, theirs) = terminal();
        let mut info = tool(arm, &["info"]).stdout(side_of(&theirs)).spawn().expect("sevenbot runs");
        let text = read_until(&mut ours, "servo bus errors");
        assert!(text.contains("\x1b[32mnone"), "no servo is missing, in green: {text}");
        info.wait().expect("it ends");
        arm.reopen(115_200);
    });
}
