//! `stop`, Ctrl-C, and commands whose writes are lost: what they report, and what they leave in the registers.

#![cfg(unix)]

use std::process::{Command, Output, Stdio};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use crate::fake::{
    LineFault, POSE, arm_on_faulty_line, arm_that_loses_writes_after, execute, moving_registers, scripted_arm,
};
use protocol_core::request::Request;

fn command(port: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sevenbot"));
    command.args(["--port", port, "--timeout", "10000"]).args(arguments);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

#[track_caller]
fn may_be_moving(output: &Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("the arm may still be moving"), "{said}");
    assert!(said.contains("switch off the supply of the servos"), "{said}");
    assert!(!said.contains("the arm holds"), "{said}");
}

#[test]
fn lost_commands_report_that_the_arm_may_be_moving() {
    for arguments in [["stop"].as_slice(), &["home"], &["home", "--wait"], &["state", "damping", "--yes"]] {
        let (port, _held, _told) = arm_that_loses_writes_after(0);
        may_be_moving(&command(&port, arguments).output().unwrap());
    }
}

#[test]
fn ctrl_c_without_effect_reports_that_the_arm_may_be_moving() {
    let (port, _held, writes) = arm_that_loses_writes_after(1);
    let tool = command(&port, &["pose", "10", "_", "_", "_", "_", "_", "_", "--wait"]).spawn().unwrap();
    writes.recv_timeout(Duration::from_secs(60)).expect("the pose is written");
    assert!(Command::new("kill").args(["-INT", &tool.id().to_string()]).status().unwrap().success());
    may_be_moving(&tool.wait_with_output().unwrap());
}

#[test]
fn ctrl_c_stops_a_pose_and_says_that_the_arm_holds() {
    let registers = moving_registers();
    let shown = Arc::clone(&registers);
    let (report_write, writes) = mpsc::channel();
    let (port, _held) = scripted_arm(move |_, request| {
        let mut registers = registers.lock().unwrap();
        let reply = execute(&mut registers, request);
        if matches!(request, Request::Write { .. }) {
            let _ = report_write.send(());
            registers[243] = u8::from(registers[46] != POSE[0]);
        }
        reply
    });
    let tool = command(&port, &["pose", "10", "_", "_", "_", "_", "_", "_", "--wait"]).spawn().unwrap();
    writes.recv_timeout(Duration::from_secs(60)).expect("the pose is written");
    assert!(Command::new("kill").args(["-INT", &tool.id().to_string()]).status().unwrap().success());
    let output = tool.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("the arm holds where it is"), "{said}");
    assert_eq!(shown.lock().unwrap()[46..53], POSE);
}

#[test]
fn a_stop_of_an_undriven_arm_writes_nothing() {
    let registers = moving_registers();
    registers.lock().unwrap()[29] = 2;
    let shown = Arc::clone(&registers);
    let (port, _held) = arm_on_faulty_line(&registers, usize::MAX, LineFault::Lost);
    let output = command(&port, &["stop"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("state 2, forceless"), "{said}");
    assert_eq!(shown.lock().unwrap()[46], 170);
}

#[test]
fn ctrl_c_during_a_change_of_the_baud_rate_closes_the_eeprom_lock() {
    let registers = moving_registers();
    let shown = Arc::clone(&registers);
    let (report_write, writes) = mpsc::channel();
    let (resume, is_interrupted) = mpsc::channel();
    let (port, _held) = scripted_arm(move |_, request| {
        let mut registers = registers.lock().unwrap();
        if matches!(request, Request::Write { address: 28, values: [0] }) {
            report_write.send(()).unwrap();
            is_interrupted.recv().unwrap();
        }
        execute(&mut registers, request)
    });
    let tool = command(&port, &["baud", "57600"]).spawn().unwrap();
    writes.recv_timeout(Duration::from_secs(60)).expect("the lock is opened");
    assert!(Command::new("kill").args(["-INT", &tool.id().to_string()]).status().unwrap().success());
    // The tool handles the signal in a thread of its own. The arm answers only after this pause.
    std::thread::sleep(Duration::from_secs(1));
    resume.send(()).unwrap();
    let output = tool.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{output:?}");
    assert_eq!(shown.lock().unwrap()[28], 1, "locked");
}
