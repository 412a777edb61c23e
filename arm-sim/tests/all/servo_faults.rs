//! Faults of the simulated servos and of their bus.

use crate::rig::{Rig, near};
use arm_sim::servo::ServoFault;
use motion_core::servo_bus::frame::{error, ping, register, sync_write, write};
use protocol_core::registers::Joint;
use protocol_core::time::Duration;

const BASE: Joint = Joint::ALL[0];
const CLAW: Joint = Joint::ALL[6];
/// The position of joint 1 in the standard pose.
const BASE_START: u16 = 511;

#[test]
fn a_missing_servo_does_not_answer_and_returns_without_torque() {
    let mut rig = Rig::ready();
    rig.torque(BASE, 1);
    rig.goal(BASE, 600, 0, 0);
    rig.pass(1_000);
    rig.plant.set_fault(BASE, Some(ServoFault::Missing));
    assert!(rig.reading(BASE).is_none());
    assert!(rig.reading(CLAW).is_some(), "the others answer");
    rig.goal(BASE, 700, 0, 0);
    rig.plant.set_fault(BASE, None);
    assert!(rig.reading(BASE).is_none(), "it starts");
    rig.pass(200);
    assert_eq!(rig.reading(BASE).map(|(reading, _)| near(reading.position_counts, 600)), Some(true));
    rig.goal(BASE, 700, 0, 0);
    rig.pass(1_000);
    assert!(near(rig.counts(BASE), 600));
}

#[test]
fn a_late_servo_answers_late() {
    let mut rig = Rig::ready();
    rig.plant.set_fault(BASE, Some("late".parse().unwrap()));
    let (bytes, micros) = rig.ask(|b| ping(b, 0));
    assert_eq!((bytes.len(), micros), (6, 30_000 + 370));
    // The answer of another servo overtakes the late one.
    rig.send(|b| ping(b, 0));
    let (bytes, _) = rig.ask(|b| ping(b, 6));
    assert_eq!([bytes[2], bytes[8]], [6, 0]);
    rig.plant.set_fault(BASE, None);
    assert_eq!(rig.ask(|b| ping(b, 0)).1, 370);
}

#[test]
fn a_garbled_servo_sends_wrong_checksums() {
    let mut rig = Rig::ready();
    rig.plant.set_fault(BASE, Some(ServoFault::Garbled(1)));
    assert!((0..5).all(|_| rig.reading(BASE).is_none()));
    rig.plant.set_fault(BASE, Some(ServoFault::Garbled(3)));
    let good = (0..30).filter(|_| rig.reading(BASE).is_some()).count();
    assert_eq!(good, 20);
    rig.plant.set_fault(BASE, None);
    assert!(rig.reading(BASE).is_some());
}

#[test]
fn a_stuck_servo_is_overloaded_until_torque_is_cycled() {
    let mut rig = Rig::ready();
    rig.plant.set_fault(BASE, Some(ServoFault::Stuck));
    rig.torque(BASE, 1);
    rig.goal(BASE, 800, 0, 0);
    rig.pass(500);
    let (reading, errors) = rig.reading(BASE).unwrap();
    assert_eq!((reading.position_counts, reading.load, errors), (BASE_START, 1_000, 0));
    rig.pass(1_000);
    assert_eq!(rig.reading(BASE).unwrap().1, error::OVERLOAD);
    rig.plant.set_fault(BASE, None);
    rig.goal(BASE, 700, 0, 0);
    let (ack, _) = rig.ask(|b| write(b, 0, register::TORQUE_SWITCH, &[1]));
    assert_eq!(ack, [0xFF, 0xFF, 0, 2, error::OVERLOAD, 0xDD], "each answer carries the error");
    rig.pass(1_000);
    let (reading, errors) = rig.reading(BASE).unwrap();
    assert_eq!((reading.position_counts, reading.load), (BASE_START, 0), "its motor is off");
    assert_eq!(errors, error::OVERLOAD, "a write that changes nothing has no effect");
    rig.torque(BASE, 0);
    rig.torque(BASE, 1);
    rig.pass(1_000);
    let (reading, errors) = rig.reading(BASE).unwrap();
    assert_eq!((reading.position_counts, errors), (700, 0));
}

#[test]
fn an_echo_comes_before_the_answer() {
    let mut rig = Rig::ready();
    rig.plant.set_echo(true);
    let (bytes, micros) = rig.ask(|b| ping(b, 0));
    assert_eq!(bytes, [0xFF, 0xFF, 0, 2, 1, 0xFC, 0xFF, 0xFF, 0, 2, 0, 0xFD]);
    assert_eq!(micros, 370);
    rig.plant.set_echo(false);
    assert_eq!(rig.ask(|b| ping(b, 0)).0.len(), 6);
}

#[test]
fn garbage_and_damaged_frames_are_ignored() {
    let mut rig = Rig::ready();
    let garbage: Vec<u8> = (0..2_000_u32).map(|i| (i * i % 251).to_le_bytes()[0]).collect();
    rig.plant.bytes(rig.now, &garbage);
    rig.plant.bytes(rig.now, &[0xFF, 0xFF, 0, 2, 1, 0xFD]);
    assert_eq!(rig.plant.deadline(), None);
    rig.pass(100);
    assert_eq!(rig.ask(|b| ping(b, 0)).0.len(), 6);
}

#[test]
fn a_frame_that_begins_while_a_servo_drives_the_line_is_lost() {
    for (pause_us, is_lost) in [(0, true), (19, true), (20, false)] {
        let mut rig = Rig::ready();
        rig.plant.set_echo(true);
        rig.send(|b| ping(b, 0));
        let answered_at = rig.plant.deadline().unwrap() + Duration::from_micros(250 + 60);
        assert_eq!(rig.plant.poll(answered_at).len(), 12, "echo and answer");
        rig.now = answered_at + Duration::from_micros(pause_us);
        let (bytes, _) = rig.ask(|b| ping(b, 6));
        assert_eq!(rig.plant.collisions(), u64::from(is_lost), "{pause_us} us");
        if is_lost {
            assert_eq!(bytes, [0xFF, 0xFF, 6, 2, 1, 0xF6].map(|byte| byte ^ 0x55), "the echo is damaged");
        } else {
            assert_eq!(bytes.len(), 12);
        }
        assert_eq!(rig.ask(|b| ping(b, 6)).0.len(), 12, "the next frame is received");
    }
}

#[test]
fn frames_without_a_pause_collide_only_with_an_answer_between_them() {
    let mut rig = Rig::ready();
    rig.send(|b| sync_write(b, register::TORQUE_SWITCH, (0..7).map(|id| (id, [1]))));
    assert_eq!(rig.ask(|b| ping(b, 0)).0.len(), 6, "no servo answers a sync write");
    rig.send(|b| ping(b, 0));
    // The frame of 57 bytes takes 570 us on the wire: the answer to the ping overlaps with it.
    let goal = |id: u8| (id, [2, 0, 0, 0, 1, 44]);
    let (bytes, _) = rig.ask(|b| sync_write(b, register::GOAL_POSITION, (0..7).map(goal)));
    assert_eq!((rig.plant.collisions(), bytes.len()), (1, 6));
    assert_ne!(bytes, [0xFF, 0xFF, 0, 2, 0, 0xFD], "the answer is damaged");
}
