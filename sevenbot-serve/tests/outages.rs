//! While the arm is unplugged or silent, nothing is kept for it, and its programs are told.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

mod rig;

use protocol_core::registers::map::{PRESENT_POSITION, TARGET_POSITION};
use protocol_core::time::Duration;
use rig::{SHARING, World, read, sharing, write};

const POSE: [u8; 7] = [90, 90, 65, 90, 90, 90, 80];

#[test]
fn nothing_that_was_sent_to_an_unplugged_arm_is_carried_out() {
    let mut world = World::new(2);
    world.unplug();
    for turn in 0..3_000_u32 {
        let value = u8::try_from(turn % 100).unwrap() + 40;
        world.send(0, &write(TARGET_POSITION.address, &[value]));
    }
    world.run(100);
    assert!(!world.programs[0].is_waiting(), "nothing is kept");
    world.plug();
    world.run(2_000);
    assert_eq!(world.arm.registers().read(TARGET_POSITION.address, 7), POSE);
}

#[test]
fn without_an_arm_a_program_can_read_that_there_is_none() {
    let mut world = World::new(1);
    world.unplug();
    world.send(0, &[read(PRESENT_POSITION.address, 7), read(SHARING.0, SHARING.1), read(231, 8)].concat());
    world.run(10);
    assert_eq!(world.take(0), [(SHARING.0, vec![1, 1, 0, 0, 8, 0, 0, 0])], "nothing else is answered");
    world.plug();
    world.run(1_000);
    assert_eq!(sharing(&mut world, 0)[4], 0);
}

/// The program sends reads all the time, and takes no reply.
#[test]
fn replies_without_an_arm_do_not_pile_up() {
    let mut world = World::new(1);
    world.unplug();
    world.programs[0].reads = false;
    for _ in 0..2_000 {
        world.send(0, &read(SHARING.0, SHARING.1));
        world.run(1);
    }
    assert!(world.programs[0].unread_bytes() < 6_000, "{}", world.programs[0].unread_bytes());
}

#[test]
fn without_an_arm_a_page_is_told() {
    let mut world = World::new(0);
    world.join_page();
    world.unplug();
    for message in
        [r#"{"cmd":"angle","id":0,"angle":80}"#, r#"{"cmd":"stop"}"#, r#"{"cmd":"IK5","pos":[0,250,100]}"#]
    {
        world.send_message(0, message);
    }
    world.run(100);
    let answers = &world.pages[0].answers;
    assert!(
        answers.iter().all(|(_, answer)| answer.contains("does not answer")) && answers.len() == 3,
        "{answers:?}"
    );
}

/// The arm is switched off behind an adapter that stays: the port stays open.
#[test]
fn an_arm_without_power_is_told_while_a_program_reads_or_somebody_watches() {
    for watches in [false, true] {
        let mut world = World::new(2);
        world.join_page();
        if watches {
            world.hub.watch_arm();
        }
        (world.loses_replies, world.loses_requests) = (true, true);
        if !watches {
            world.run(10_000);
            assert!(world.hub.has_arm(), "nobody asked");
            world.send(0, &read(PRESENT_POSITION.address, 7));
        }
        world.run(2_900);
        assert!(world.hub.has_arm());
        world.run(1_300);
        assert!(!world.hub.has_arm());
        assert_eq!(sharing(&mut world, 1)[4], 8);
        assert!(world.page_round_trip(0, r#"{"cmd":"read","id":54,"num":7}"#) < Duration::from_millis(5));
        world.send(0, &write(TARGET_POSITION.address, &[150]));
        world.power_cycle();
        (world.loses_replies, world.loses_requests) = (false, false);
        world.run(600);
        assert!(world.hub.has_arm());
        assert_eq!(world.arm.registers().read(TARGET_POSITION.address, 7), POSE, "nothing is kept");
        world.round_trip(0, &read(PRESENT_POSITION.address, 7));
    }
}

/// Replies are lost for 2.5 seconds at a time, and come again in between.
#[test]
fn an_arm_that_answers_seldom_is_an_arm() {
    let mut world = World::new(1);
    world.hub.watch_arm();
    for _ in 0..10 {
        world.loses_replies = true;
        world.run(2_500);
        world.loses_replies = false;
        world.run(1_100);
        assert!(world.hub.has_arm());
    }
}

/// A watched arm is asked once a second, and not more.
#[test]
fn nobody_disturbs_an_arm_that_nobody_uses() {
    for (watches, questions) in [(false, 0), (true, 10)] {
        let mut world = World::new(1);
        if watches {
            world.hub.watch_arm();
        }
        world.run(1_500);
        world.sent.clear();
        world.run(10_000);
        assert_eq!(world.sent.len(), 7 * questions);
    }
}
