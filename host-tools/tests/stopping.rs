//! Stopping an arm over a line that loses, damages or delays one frame, whichever it is; and the commands against an
//! arm that takes nothing, through a real pseudo-terminal.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod fake;

use std::process::{Command, Output, Stdio};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use fake::{IDENTITY, arm_that, reply};
use protocol_core::request::Request;
use serialport::TTYPort;
use sevenbot::joints::NotHeld;
use sevenbot::{Arm, Error, Options};

const POSE: [u8; 7] = [120, 90, 65, 90, 90, 90, 0];
/// Frames wait this long; the many attempts give a busy machine ten seconds.
const PATIENT: Options = Options { baud: 115_200, reply_timeout: Duration::from_millis(200), attempts: 50 };

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Damage {
    Lost,
    Garbled,
    /// A reply comes together with the next one; a request is lost.
    Late,
}

/// The registers of an arm in the servo state whose joints 1 and 7 are on their way, the last from 0 degrees.
fn under_way() -> Arc<Mutex<[u8; 256]>> {
    let mut registers = [0; 256];
    registers[..8].copy_from_slice(&IDENTITY);
    registers[28..30].copy_from_slice(&[1, 1]);
    registers[46..53].copy_from_slice(&[170, 90, 65, 90, 90, 90, 80]);
    registers[54..61].copy_from_slice(&POSE);
    registers[240] = 1;
    registers[243] = 0b100_0001;
    Arc::new(Mutex::new(registers))
}

/// Does what a request says; returns the reply.
fn obey(registers: &mut [u8; 256], request: &Request<'_>) -> Vec<u8> {
    match *request {
        Request::Read { address, count } => {
            let first = usize::from(address);
            reply(address, &registers[first..first + usize::from(count)])
        }
        Request::Write { address, values } => {
            let first = usize::from(address);
            registers[first..first + values.len()].copy_from_slice(values);
            registers[243] = 0;
            Vec::new()
        }
    }
}

/// An arm with these registers, on a line that harms its frame number `harmed`, requests and replies counted together.
fn on_a_bad_line(registers: &Arc<Mutex<[u8; 256]>>, harmed: usize, damage: Damage) -> (String, TTYPort) {
    let registers = Arc::clone(registers);
    let (mut frame, mut late) = (0, Vec::new());
    let mut is_harmed = move || {
        frame += 1;
        frame - 1 == harmed
    };
    arm_that(move |_, request| {
        let mut registers = registers.lock().unwrap();
        if is_harmed() {
            registers[248] += u8::from(damage == Damage::Garbled);
            return Vec::new();
        }
        let mut bytes = obey(&mut registers, request);
        if !bytes.is_empty() && is_harmed() {
            match damage {
                Damage::Lost => bytes.clear(),
                Damage::Garbled => bytes[5] ^= 1,
                Damage::Late => late = std::mem::take(&mut bytes),
            }
            return bytes;
        }
        [std::mem::take(&mut late), bytes].concat()
    })
}

#[test]
fn a_stop_survives_the_loss_of_any_frame() {
    for damage in [Damage::Lost, Damage::Garbled, Damage::Late] {
        for harmed in 0..14 {
            let registers = under_way();
            let (name, _port) = on_a_bad_line(&registers, harmed, damage);
            let mut arm = Arm::open_with(&name, PATIENT).unwrap();
            let held = arm.hold().unwrap_or_else(|error| panic!("{damage:?} {harmed}: {error}"));
            assert_eq!(held.targets(), POSE, "{damage:?} {harmed}");
            assert_eq!(registers.lock().unwrap()[46..53], POSE, "{damage:?} {harmed}");
        }
    }
}

#[test]
fn a_checked_write_survives_the_loss_of_any_frame() {
    for damage in [Damage::Lost, Damage::Garbled, Damage::Late] {
        for harmed in 0..14 {
            let registers = under_way();
            let (name, _port) = on_a_bad_line(&registers, harmed, damage);
            let mut arm = Arm::open_with(&name, PATIENT).unwrap();
            assert_eq!(arm.write_checked(29, &[0]), Ok(vec![]), "{damage:?} {harmed}");
            assert_eq!(registers.lock().unwrap()[29], 0, "{damage:?} {harmed}");
        }
    }
}

#[test]
fn a_late_reply_is_not_the_reply_to_the_next_read_of_the_same_registers() {
    let mut reads = 0;
    let (name, _port) = arm_that(move |_, request| {
        let Request::Read { address, count } = *request else { return Vec::new() };
        reads += 1;
        let values = |value| reply(address, &vec![value; count.into()]);
        match reads {
            1 => reply(0, &IDENTITY),
            // The first attempt gets no reply in time.
            2 => Vec::new(),
            // It comes with the second attempt, whose own reply comes with the next read.
            3 => reply(10, &[1; 4]),
            4 => [reply(10, &[2; 5]), values(3)].concat(),
            _ => panic!("a read too many"),
        }
    });
    let mut arm = Arm::open_with(&name, PATIENT).unwrap();
    assert_eq!(arm.read(10, 4), Ok(vec![1; 4]));
    assert_eq!(arm.read(10, 4), Ok(vec![3; 4]), "not the late one");
}

#[test]
fn a_report_is_not_the_reply_to_a_read_of_the_positions() {
    let registers = under_way();
    let (name, _port) = arm_that(move |_, request| {
        let report = reply(54, &[9; 7]);
        [report, obey(&mut registers.lock().unwrap(), request)].concat()
    });
    let mut arm = Arm::open_with(&name, PATIENT).unwrap();
    assert_eq!(arm.positions().unwrap().map(sevenbot::Angle::degrees), POSE);
    assert_eq!(arm.reports().count(), 2);
}

#[test]
fn ranges_past_the_last_register_are_not_sent() {
    let registers = under_way();
    let (name, _port) = on_a_bad_line(&registers, usize::MAX, Damage::Lost);
    let mut arm = Arm::open_with(&name, PATIENT).unwrap();
    assert_eq!(arm.write(250, &[0; 10]), Err(Error::OutsideMap { address: 250, count: 10 }));
    assert_eq!(arm.write(0, &[0; 256]), Err(Error::OutsideMap { address: 0, count: 256 }));
    assert_eq!(arm.read(250, 7), Err(Error::OutsideMap { address: 250, count: 7 }));
    assert_eq!(arm.read(250, 6).map(|values| values.len()), Ok(6));
}

/// An arm that takes so many writes, and then loses them all. It tells of each write.
fn deaf_after(takes: usize) -> (String, TTYPort, mpsc::Receiver<()>) {
    let registers = under_way();
    let (tell, told) = mpsc::channel();
    let mut writes = 0;
    let (name, port) = arm_that(move |_, request| {
        let mut registers = registers.lock().unwrap();
        if matches!(request, Request::Write { .. }) {
            writes += 1;
            let _ = tell.send(());
            if writes > takes {
                return Vec::new();
            }
        }
        let reply = obey(&mut registers, request);
        // A move never ends here.
        registers[243] = 0b100_0001;
        reply
    });
    (name, port, told)
}

#[test]
fn a_stop_that_the_arm_does_not_take_is_an_error() {
    let (name, _port, told) = deaf_after(0);
    let mut arm = Arm::open_with(&name, PATIENT).unwrap();
    assert!(matches!(arm.hold(), Err(NotHeld::NotTaken(targets)) if targets.len() == 2));
    assert_eq!(
        told.try_iter().count(),
        1 + 4 * 2,
        "all joints once, then both that did not take it, each in a frame"
    );
}

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
    assert!(said.contains("switch the supply of the servos off"), "{said}");
    assert!(!said.contains("the arm holds"), "{said}");
}

#[test]
fn commands_that_the_arm_does_not_take_say_that_it_may_be_moving() {
    for arguments in [["stop"].as_slice(), &["home"], &["home", "--wait"], &["state", "damping", "--yes"]] {
        let (port, _held, _told) = deaf_after(0);
        may_be_moving(&command(&port, arguments).output().unwrap());
    }
}

#[test]
fn ctrl_c_that_cannot_stop_the_arm_says_so() {
    let (port, _held, told) = deaf_after(1);
    let tool = command(&port, &["pose", "10", "_", "_", "_", "_", "_", "_", "--wait"]).spawn().unwrap();
    told.recv_timeout(Duration::from_secs(60)).expect("the pose is written");
    assert!(Command::new("kill").args(["-INT", &tool.id().to_string()]).status().unwrap().success());
    may_be_moving(&tool.wait_with_output().unwrap());
}

#[test]
fn ctrl_c_stops_a_pose_and_says_that_the_arm_holds() {
    let registers = under_way();
    let shown = Arc::clone(&registers);
    let (tell, told) = mpsc::channel();
    let (port, _held) = arm_that(move |_, request| {
        let mut registers = registers.lock().unwrap();
        let reply = obey(&mut registers, request);
        if matches!(request, Request::Write { .. }) {
            let _ = tell.send(());
            registers[243] = u8::from(registers[46] != POSE[0]);
        }
        reply
    });
    let tool = command(&port, &["pose", "10", "_", "_", "_", "_", "_", "_", "--wait"]).spawn().unwrap();
    told.recv_timeout(Duration::from_secs(60)).expect("the pose is written");
    assert!(Command::new("kill").args(["-INT", &tool.id().to_string()]).status().unwrap().success());
    let output = tool.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("the arm holds where it is"), "{said}");
    assert_eq!(shown.lock().unwrap()[46..53], POSE);
}

#[test]
fn a_stop_of_an_arm_that_is_not_driven_writes_nothing() {
    let registers = under_way();
    registers.lock().unwrap()[29] = 2;
    let shown = Arc::clone(&registers);
    let (port, _held) = on_a_bad_line(&registers, usize::MAX, Damage::Lost);
    let output = command(&port, &["stop"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("state 2, forceless"), "{said}");
    assert_eq!(shown.lock().unwrap()[46], 170);
}
