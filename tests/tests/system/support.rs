//! Tests of the library that the system tests use: programs under test, frames, the frame splitter, random numbers.

use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::thread;

use rustix::process::{Pid, test_kill_process};
use system_tests::frames::{FrameSplitter, is_target, reply};
use system_tests::process::{RunningProgram, lines, start, wait_for_exit};
use system_tests::random::Random;
use system_tests::{read_request, write_request};

/// A shell that prints its process id, and waits.
fn shell() -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", "echo $$; exec sleep 600"]);
    command
}

fn is_running(id: &str) -> bool {
    let id = id.trim().parse().ok().and_then(Pid::from_raw);
    test_kill_process(id.expect("a process id")).is_ok()
}

#[test]
fn a_program_ends_when_its_test_panics() {
    let (sender, receiver) = mpsc::channel();
    let test = thread::spawn(move || {
        let mut program = RunningProgram::spawn(shell().stdout(Stdio::piped()));
        let lines = lines(program.stdout.take().expect("a pipe"));
        sender.send(lines.recv().expect("a line")).expect("a receiver");
        panic!("the test fails");
    });
    assert!(test.join().is_err());
    assert!(!is_running(&receiver.recv().expect("a process id")));
}

#[test]
fn a_program_that_is_not_ready_ends() {
    let id = start(&mut shell(), 1).expect_err("not ready");
    assert!(!is_running(&id), "{id}");
}

#[test]
fn a_program_that_has_ended_is_not_killed_again() {
    let mut program = RunningProgram::spawn(&mut Command::new("true"));
    assert!(wait_for_exit(&mut program).success());
    program.kill();
    program.kill();
    let output = RunningProgram::spawn(Command::new("echo").arg("text").stdout(Stdio::piped())).output();
    assert_eq!(output.stdout, b"text\n");
}

#[test]
fn frames_equal_the_documented_examples() {
    assert_eq!(read_request(54, 7), [0xaa, 0x77, 0x03, 0x36, 0x07, 0x81, 0xce]);
    assert_eq!(write_request(28, &[0]), [0xaa, 0x77, 0x06, 0x1c, 0x01, 0x00, 0x2c, 0xc4]);
    let positions = [90, 90, 65, 90, 90, 90, 80];
    let documented = [0xaa, 0x77, 0x03, 0x36, 0x07, 0x5a, 0x5a, 0x41, 0x5a, 0x5a, 0x5a, 0x50, 0x43, 0x81];
    assert_eq!(reply(54, &positions), documented);
}

fn cut(is_of_arm: bool, bytes: &[u8]) -> (Vec<Vec<u8>>, u32) {
    let mut splitter = FrameSplitter::new(is_of_arm);
    let mut found = Vec::new();
    for &byte in bytes {
        splitter.push(&[byte]);
        found.extend(splitter.next());
    }
    (found, splitter.count())
}

#[test]
fn frames_are_cut_and_counted() {
    let requests = [read_request(54, 7), write_request(46, &[90; 7]), read_request(0, 8)];
    assert_eq!(cut(false, &requests.concat()), (requests.to_vec(), 3));
    let replies = [reply(54, &[90; 7]), vec![0x20], reply(0, &[7; 8])];
    assert_eq!(cut(true, &replies.concat()), (replies.to_vec(), 2), "text between frames");
}

#[test]
fn a_target_is_seen_in_any_write_that_holds_one() {
    assert!(is_target(&write_request(46, &[1])) && is_target(&write_request(29, &[1; 30])));
    assert!(is_target(&write_request(140, &[1, 0])) && !is_target(&write_request(128, &[])));
    assert!(!is_target(&write_request(32, &[1; 7])) && !is_target(&read_request(46, 7)));
}

#[test]
fn a_seed_gives_the_same_numbers_again() {
    let numbers = |seed| {
        let mut random = Random::new(seed);
        [random.bits(), random.below(10), random.below(10)]
    };
    assert_eq!(numbers(7), numbers(7));
    assert_ne!(numbers(7), numbers(8));
    assert_eq!(Random::new(0).bits(), 0xE220_A839_7B1D_CDAF, "the published first number");
}
