//! Stopping an arm over a line that loses, damages or delays one frame, whichever it is.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod fake;

use std::time::Duration;

use fake::{Damage, IDENTITY, POSE, arm_that, deaf_after, obey, on_a_bad_line, reply, under_way};
use protocol_core::request::Request;
use sevenbot::hold::NotHeld;
use sevenbot::{Arm, Error, Options};

/// Frames wait this long; the many attempts give a busy machine ten seconds.
const PATIENT: Options = Options { baud: 115_200, reply_timeout: Duration::from_millis(200), attempts: 50 };

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
