//! Stops, writes and reads on a line that loses, damages or delays a frame, between reports, and with an arm that takes no
//! writes.

#![cfg(unix)]

use std::time::Duration;

use crate::fake::{
    IDENTITY, LineFault, POSE, arm_on_faulty_line, arm_that_loses_writes_after, execute, moving_registers,
    reply, scripted_arm,
};
use protocol_core::request::Request;
use sevenbot::checked_write::WriteError;
use sevenbot::hold::HoldError;
use sevenbot::moves::MoveError;
use sevenbot::{Arm, ArmOptions, Error};

/// 50 attempts of 200 ms give a busy machine ten seconds for a reply.
const OPTIONS: ArmOptions =
    ArmOptions { baud: 115_200, reply_timeout: Duration::from_millis(200), attempts: 50, map: None };

#[test]
fn a_stop_succeeds_despite_one_lost_frame() {
    for fault in [LineFault::Lost, LineFault::Garbled, LineFault::Late] {
        for faulty_frame in 0..14 {
            let registers = moving_registers();
            let (name, _port) = arm_on_faulty_line(&registers, faulty_frame, fault);
            let mut arm = Arm::open_with(&name, OPTIONS).unwrap();
            let held = arm.hold().unwrap_or_else(|error| panic!("{fault:?} {faulty_frame}: {error}"));
            assert_eq!(held.targets(), POSE, "{fault:?} {faulty_frame}");
            assert_eq!(registers.lock().unwrap()[46..53], POSE, "{fault:?} {faulty_frame}");
        }
    }
}

#[test]
fn an_arm_that_is_lost_while_its_hold_is_watched_may_be_moving() {
    let registers = moving_registers();
    let (name, _port) = scripted_arm(move |_, request| match request {
        // The watch begins with this read.
        Request::Read { address: 29, count: 2 } => Vec::new(),
        _ => execute(&mut registers.lock().unwrap(), request),
    });
    let options = ArmOptions { attempts: 1, ..OPTIONS };
    let lost = Arm::open_with(&name, options).unwrap().hold_and_watch();
    assert!(
        matches!(lost, Err(MoveError::MayMove(WriteError::Exchange(Error::NoAnswer { .. })))),
        "{lost:?}"
    );
}

#[test]
fn a_checked_write_succeeds_despite_one_lost_frame() {
    for fault in [LineFault::Lost, LineFault::Garbled, LineFault::Late] {
        for faulty_frame in 0..14 {
            let registers = moving_registers();
            let (name, _port) = arm_on_faulty_line(&registers, faulty_frame, fault);
            let mut arm = Arm::open_with(&name, OPTIONS).unwrap();
            assert_eq!(arm.write_checked(29, &[0]), Ok(()), "{fault:?} {faulty_frame}");
            assert_eq!(registers.lock().unwrap()[29], 0, "{fault:?} {faulty_frame}");
        }
    }
}

#[test]
fn a_late_reply_is_not_the_reply_to_the_next_read_of_the_same_registers() {
    let mut reads = 0;
    let (name, _port) = scripted_arm(move |_, request| {
        let Request::Read { address, count } = *request else { return Vec::new() };
        reads += 1;
        let values = |value| reply(address, &vec![value; count.into()]);
        match reads {
            1 => reply(0, &IDENTITY),
            // The first attempt gets no reply in time.
            2 => Vec::new(),
            // The reply to the first attempt arrives during the second, and the reply to the second during the next read.
            3 => reply(10, &[1; 4]),
            4 => [reply(10, &[2; 5]), values(3)].concat(),
            _ => panic!("a read too many"),
        }
    });
    let mut arm = Arm::open_with(&name, OPTIONS).unwrap();
    assert_eq!(arm.read(10, 4), Ok(vec![1; 4]));
    assert_eq!(arm.read(10, 4), Ok(vec![3; 4]), "not the late one");
}

#[test]
fn a_report_is_not_the_reply_to_a_read_of_the_positions() {
    let registers = moving_registers();
    let (name, _port) = scripted_arm(move |_, request| {
        let report = reply(54, &[9; 7]);
        [report, execute(&mut registers.lock().unwrap(), request)].concat()
    });
    let mut arm = Arm::open_with(&name, OPTIONS).unwrap();
    assert_eq!(arm.positions().unwrap().map(sevenbot::Angle::degrees), POSE);
    assert_eq!(arm.reports().count(), 2);
}

#[test]
fn ranges_past_the_last_register_are_not_sent() {
    let registers = moving_registers();
    let (name, _port) = arm_on_faulty_line(&registers, usize::MAX, LineFault::Lost);
    let mut arm = Arm::open_with(&name, OPTIONS).unwrap();
    assert_eq!(arm.write(250, &[0; 10]), Err(Error::OutsideMap { address: 250, count: 10 }));
    assert_eq!(arm.write(0, &[0; 256]), Err(Error::OutsideMap { address: 0, count: 256 }));
    assert_eq!(arm.read(250, 7), Err(Error::OutsideMap { address: 250, count: 7 }));
    assert_eq!(arm.read(250, 6).map(|values| values.len()), Ok(6));
}

#[test]
fn a_stop_that_the_arm_does_not_take_is_an_error() {
    let (name, _port, writes) = arm_that_loses_writes_after(0);
    let mut arm = Arm::open_with(&name, OPTIONS).unwrap();
    assert!(
        matches!(arm.hold(), Err(HoldError(WriteError::NotTaken(targets))) if targets.registers().len() == 2)
    );
    assert_eq!(
        writes.try_iter().count(),
        1 + 4 * 2,
        "all joints once, then both that did not take it, each in a frame"
    );
}
