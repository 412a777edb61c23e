//! Programs share an arm and use its extended block: reports (D26) and the watchdog (D24).

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

mod rig;

use protocol_core::registers::map::{
    FAULTS, FEEDBACK_FREQUENCY, FINE_POSITION, FINE_TARGET, HOST_WATCHDOG, MOTOR_STATE, PRESENT_POSITION,
    REPORT_CONTENT, TARGET_POSITION, WATCHDOG_ACTION, fault, report_content,
};
use protocol_core::time::Duration;
use rig::{World, read, write};

/// 90 degrees in hundredths, low byte first.
const POINT: [u8; 2] = [0x28, 0x23];
/// The watchdog in steps of 10 ms, and in milliseconds.
const STEPS: u8 = 20;
const TIMEOUT_MS: u64 = 200;

/// Fault bit 6, as a program reads it.
fn has_acted(world: &mut World, program: usize) -> bool {
    world.take(program);
    world.send(program, &read(FAULTS.address, 1));
    world.run(10);
    let faults = world.take(program).into_iter().find(|(address, _)| *address == FAULTS.address);
    faults.expect("a reply").1[0] & fault::HOST_SILENT != 0
}

/// A program that streams with a watchdog, and one that reads and has reports.
fn streamer_and_reader() -> World {
    let mut world = World::new(2);
    world.send(0, &write(HOST_WATCHDOG.address, &[STEPS]));
    world.send(1, &write(FEEDBACK_FREQUENCY.address, &[50]));
    for _ in 0..20 {
        world.send(0, &write(FINE_TARGET.address, &POINT));
        world.send(1, &read(PRESENT_POSITION.address, 3));
        world.run(50);
    }
    world
}

/// The joint moves and the streamer is silent. The arm holds in time, and the hold delays no other program.
#[test]
fn d24_the_frames_of_others_do_not_keep_the_watchdog_of_a_silent_program_alive() {
    let mut world = streamer_and_reader();
    assert!(!has_acted(&mut world, 1), "the program sends every 50 ms");
    world.send(0, &write(TARGET_POSITION.address, &[150]));
    let delays: Vec<_> = (0..200).map(|_| world.round_trip(1, &read(1, 2))).collect();
    assert!(delays.iter().all(|time| *time < Duration::from_millis(20)), "nobody waits");
    assert!(has_acted(&mut world, 1));
    let held = world.arm.registers().get(TARGET_POSITION.address);
    assert!((95..145).contains(&held), "it was on its way: {held}");
    world.run(500);
    assert_eq!(world.arm.registers().get(TARGET_POSITION.address), held, "once in each silence");
}

#[test]
fn d24_a_short_watchdog_is_the_servers_and_the_arm_gets_a_longer_one() {
    let mut world = World::new(2);
    for steps in [0, 1, 19, 20, 255] {
        world.send(0, &write(HOST_WATCHDOG.address, &[steps, 1]));
        world.run(10);
        let of_arm = if steps == 0 { 0 } else { steps.max(20) };
        assert_eq!(world.arm.registers().get(HOST_WATCHDOG.address), of_arm);
        world.take(1);
        world.send(1, &read(HOST_WATCHDOG.address - 1, 4));
        world.run(10);
        let reply = world.take(1).into_iter().find(|(address, _)| *address == HOST_WATCHDOG.address - 1);
        assert_eq!(reply.expect("a reply").1, [0, steps, 1, 0], "programs read what one wrote");
    }
}

#[test]
fn d24_the_watchdog_of_a_program_that_is_gone_acts() {
    for is_reset in [false, true] {
        let mut world = streamer_and_reader();
        world.send(0, &write(TARGET_POSITION.address, &[150]));
        world.run(10);
        if is_reset {
            world.reset(0);
        } else {
            world.leave(0);
        }
        world.run(TIMEOUT_MS + 30);
        assert!(has_acted(&mut world, 0));
        let held = world.arm.registers().get(TARGET_POSITION.address);
        assert!((95..145).contains(&held), "it was on its way: {held}");
    }
}

#[test]
fn d24_a_watchdog_that_damps_switches_the_motors_off() {
    let mut world = streamer_and_reader();
    world.send(0, &write(WATCHDOG_ACTION.address, &[1]));
    world.run(2 * TIMEOUT_MS);
    assert!(has_acted(&mut world, 1));
    assert_eq!(world.arm.registers().get(MOTOR_STATE.address), 0);
}

#[test]
fn d24_a_program_that_switches_its_watchdog_off_delays_nobody() {
    let mut world = streamer_and_reader();
    world.send(0, &write(HOST_WATCHDOG.address, &[0]));
    let delays: Vec<_> = (0..100).map(|_| world.round_trip(1, &read(1, 2))).collect();
    assert!(delays.iter().all(|time| *time < Duration::from_millis(20)));
    assert!(!has_acted(&mut world, 1));
}

/// A program sets the longest watchdog, 2.55 s, again and again, and is silent until the watchdog has acted.
#[test]
fn d24_no_watchdog_keeps_the_others_from_the_arm() {
    let mut world = World::new(2);
    for _ in 0..4 {
        world.send(0, &write(HOST_WATCHDOG.address, &[255]));
        for _ in 0..131 {
            let time = world.round_trip(1, &read(1, 2));
            assert!(time < Duration::from_millis(20), "{time:?}");
            world.run(20);
        }
    }
}

#[test]
fn d26_each_program_chooses_what_its_reports_hold() {
    let mut world = World::new(3);
    let contents = [report_content::POSITIONS, report_content::FINE_POSITIONS, report_content::FINE_STATE];
    for (program, content) in contents.into_iter().enumerate() {
        world.send(program, &write(REPORT_CONTENT.address, &[content]));
        world.send(program, &write(FEEDBACK_FREQUENCY.address, &[20]));
    }
    world.run(2_000);
    let expected = [(PRESENT_POSITION.address, 7), (FINE_POSITION.address, 14), (FINE_POSITION.address, 42)];
    for (program, expected) in expected.into_iter().enumerate() {
        let reports = world.take(program);
        assert!(reports.len().abs_diff(40) <= 2, "{} reports at 20 Hz", reports.len());
        assert!(reports.iter().all(|(address, values)| (*address, values.len()) == expected));
        world.send(program, &read(REPORT_CONTENT.address, 1));
        world.send(program, &write(FEEDBACK_FREQUENCY.address, &[0]));
    }
    world.run(100);
    for (program, content) in contents.into_iter().enumerate() {
        assert!(world.take(program).contains(&(REPORT_CONTENT.address, vec![content])), "its own value");
    }
    assert_eq!(world.arm.registers().get(REPORT_CONTENT.address), 0);
}
