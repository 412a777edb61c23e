//! Commands with unusual arms: the maker's firmware, another device, an unknown baud rate, missing answers.

#![cfg(unix)]

use std::process::{Command, Output, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use crate::fake::{IDENTITY, answering_arm, makers_arm, reply, scripted_arm};
use protocol_core::request::Request;
use sevenbot::ports::find_baud;

/// A long timeout for a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);

fn command(port: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sevenbot"));
    command.args(["--port", port]).args(arguments).stdin(Stdio::null());
    command
}

fn run(port: &str, arguments: &[&str], status: i32) -> String {
    said(&command(port, arguments).output().unwrap(), status)
}

fn said(output: &Output, status: i32) -> String {
    let said = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat();
    assert_eq!(output.status.code(), Some(status), "{said}");
    said
}

#[test]
fn the_makers_firmware_is_supported_with_a_warning() {
    let (port, _held) = makers_arm();
    let info = run(&port, &["info"], 0);
    assert!(
        info.contains("warning: this arm runs the maker's firmware 2.2, which has no status block"),
        "{info}"
    );
    assert!(!info.contains("Health"), "nobody knows: {info}");
    assert!(run(&port, &["info", "--json"], 0).contains("\"makers_firmware\":true"));
    let pose = run(&port, &["pose", "100", "_", "_", "_", "_", "_", "90", "--wait"], 0);
    assert!(pose.contains("100 0 0 0 0 0 90"), "only the two joints were sent anywhere: {pose}");
    run(&port, &["stop"], 0);
    let refused = run(&port, &["set", "speed.1", "101"], 2);
    assert!(refused.contains("speed.1 takes 0 to 100; nothing was written"), "{refused}");
}

#[test]
fn another_device_is_named_by_its_code() {
    let (port, _held) = answering_arm(|_, _, _| reply(0, &[9, 30, 0, 0, 0, 0, 0, 0]));
    let text = run(&port, &["info"], 3);
    assert!(text.contains("not a 7Bot V2: its device code is 9, not 7"), "{text}");
    assert!(text.contains("sevenbot ports"), "{text}");
}

#[test]
fn without_an_answer_baud_find_is_suggested() {
    for answer in [&b""[..], b"\x00\xF8\x80"] {
        let (port, _held) = answering_arm(|_, _, _| answer.to_vec());
        let text = run(&port, &["info"], 3);
        assert!(text.contains("no answer to a read of 0..7") && text.contains("baud --find"), "{text}");
    }
}

/// Needs a pseudo-terminal whose master reports the baud rate of the slave.
#[cfg(target_os = "linux")]
#[test]
fn an_unknown_rate_is_found() {
    use serialport::SerialPort;

    let listens_at = |rate: u32| {
        scripted_arm(move |line, request| match *request {
            Request::Read { address, count } if line.baud_rate().unwrap() == rate => {
                let registers = [IDENTITY.as_slice(), &[0; 248]].concat();
                let first = usize::from(address);
                reply(address, &registers[first..first + usize::from(count)])
            }
            _ => b"\x00\xF8".to_vec(),
        })
    };
    // Two attempts of 200 ms may be too short on a busy machine, so repeat.
    let found = |port: &str| {
        let tries = std::iter::repeat_with(|| command(port, &["baud", "--find"]).output().unwrap());
        said(&tries.take(50).find(|output| output.status.success()).unwrap(), 0)
    };
    let (port, _held) = listens_at(57_600);
    let text = found(&port);
    assert!(text.contains("now            57600 baud") && text.contains("use --baud 57600"), "{text}");
    let (port, _held) = listens_at(4_800);
    let text = run(&port, &["baud", "--find"], 3);
    assert!(text.contains("trying 9600 baud") && text.contains("no arm answers at any"), "{text}");
    let (port, _held) = listens_at(9_600);
    let mut tried = 0;
    let arm = std::iter::repeat_with(|| {
        tried = 0;
        find_baud(&port, |_| tried += 1).ok()
    });
    let arm = arm.take(50).flatten().next().unwrap();
    assert_eq!((arm.options().baud, tried), (9_600, 8));
}

#[test]
fn a_second_ctrl_c_ends_the_program_at_once() {
    let (moving, is_moving) = mpsc::channel();
    let mut is_sent = false;
    let (port, _held) = scripted_arm(move |_, request| match *request {
        Request::Read { .. } if is_sent => {
            let _ = moving.send(());
            Vec::new()
        }
        Request::Read { address: 0, .. } => reply(0, &IDENTITY),
        // Every register reads 1, so the motor state is servo. The registers that report problems or a server read 0.
        Request::Read { address, count } => {
            let is_problem = |address: u8| matches!(address, 195..=198 | 232..=239 | 242);
            let values = (address..=u8::MAX).take(count.into()).map(|address| u8::from(!is_problem(address)));
            reply(address, &values.collect::<Vec<_>>())
        }
        Request::Write { .. } | Request::WriteMap21 { .. } => {
            is_sent = true;
            Vec::new()
        }
    });
    let mut waiting = command(&port, &["pose", "100", "_", "_", "_", "_", "_", "_", "--wait"])
        .env("SEVENBOT_TIMEOUT", "20000")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    is_moving.recv_timeout(TIMEOUT).unwrap();
    // After the first Ctrl-C alone the program would end with another status, after several more timeouts. Two signals may
    // merge into one, so repeat.
    let id = waiting.id().to_string();
    while waiting.try_wait().unwrap().is_none() {
        assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        std::thread::sleep(Duration::from_millis(100));
    }
    said(&waiting.wait_with_output().unwrap(), 130);
}
