//! A hold of the server slows the joints down before it knows where they are, and restores their speeds, also when replies
//! and requests are lost.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

mod rig;

use protocol_core::registers::Joint;
use protocol_core::registers::map::{
    FINE_TARGET, HOST_WATCHDOG, MOTOR_STATE, MOVING_JOINTS, SET_POINT_PERIOD, SPEED, TARGET_POSITION,
    motor_state,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use rig::{World, read, write};
use sevenbot_serve::hub::HoldOutcome;

const COMMAND: u8 = 239;
const SPEEDS: [u8; 7] = [100, 90, 80, 70, 60, 50, 0];
/// A set-point period of 20 ms.
const PERIOD: [u8; 2] = [20, 0];

/// The ways to a hold of the server.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    Command,
    Watchdog,
    Page,
}

const WAYS: [Way; 3] = [Way::Command, Way::Watchdog, Way::Page];

/// Program 0 moves joint 1 at 190 degrees per second.
fn moving_world() -> World {
    let mut world = World::new(3);
    world.join_page();
    world.send(0, &[write(SPEED.address, &SPEEDS), write(TARGET_POSITION.address, &[20])].concat());
    world.run(1_500);
    world.send(0, &write(TARGET_POSITION.address, &[160]));
    world.run(250);
    world
}

fn begin_hold(world: &mut World, way: Way) {
    match way {
        Way::Command => world.send(1, &write(COMMAND, &[1])),
        // A watchdog of 10 ms, and then silence.
        Way::Watchdog => world.send(2, &write(HOST_WATCHDOG.address, &[1])),
        Way::Page => world.send_message(0, r#"{"cmd":"stop"}"#),
    }
}

fn speeds(world: &World) -> Vec<u8> {
    world.arm.registers().read(SPEED.address, SPEED.count).to_vec()
}

/// Where joint 1 is, in hundredths of a degree. Read from the simulated arm, not over the line.
fn position(world: &World) -> i32 {
    world.arm.plant().angle(Joint::ALL[0]) / 10
}

#[test]
fn a_hold_slows_the_joints_down_although_no_reply_comes() {
    for way in WAYS {
        let mut world = moving_world();
        world.loses_replies = true;
        begin_hold(&mut world, way);
        world.run(150);
        assert_eq!(speeds(&world), [1; 7], "{way:?}");
        let braked = position(&world);
        world.run(8_000);
        let crept = position(&world) - braked;
        assert!(crept < 2_000, "{way:?}: by {crept} hundredths in 8 s, at 1.9 degrees per second");
        world.loses_replies = false;
        world.run(1_000);
        assert_eq!(speeds(&world), SPEEDS, "{way:?}: restored");
        let held = position(&world);
        world.run(2_000);
        assert!((position(&world) - held).abs() <= 60, "{way:?}: it rests");
        assert!(held < 15_000, "{way:?}: on its way");
    }
}

#[test]
fn the_brake_is_repeated_until_the_arm_confirms_the_hold() {
    for way in WAYS {
        let mut world = moving_world();
        (world.loses_replies, world.loses_requests) = (true, true);
        begin_hold(&mut world, way);
        world.run(80);
        world.loses_requests = false;
        world.run(150);
        assert_eq!(speeds(&world), [1; 7], "{way:?}");
    }
}

#[test]
fn a_silent_arm_can_still_be_stopped() {
    for way in [Way::Command, Way::Page] {
        let mut world = moving_world();
        world.loses_replies = true;
        world.send(0, &[write(SPEED.address, &[2; 7]), read(0, 7)].concat());
        world.run(5_000);
        assert!(!world.hub.has_arm());
        world.sent.clear();
        begin_hold(&mut world, way);
        world.run(50);
        assert_eq!(speeds(&world), [1; 7], "{way:?}");
        world.send(0, &write(MOTOR_STATE.address, &[motor_state::FORCELESS]));
        world.run(50);
        assert_eq!(world.arm.registers().get(MOTOR_STATE.address), motor_state::FORCELESS);
    }
}

#[test]
fn a_hold_of_an_arm_that_stands_changes_nothing() {
    for way in WAYS {
        let mut world = moving_world();
        world.run(3_000);
        let targets = |world: &World| world.arm.registers().read(FINE_TARGET.address, 14).to_vec();
        let before = (targets(&world), speeds(&world));
        begin_hold(&mut world, way);
        world.run(100);
        assert_eq!((targets(&world), speeds(&world)), before, "{way:?}");
        assert!(!world.hub.is_holding());
    }
}

#[test]
fn holds_on_holds_restore_the_speeds_of_before_the_first() {
    let mut world = moving_world();
    for turn in 0..200 {
        begin_hold(&mut world, WAYS[turn % 2]);
        world.advance(7 * u64::try_from(turn).unwrap() % 90);
    }
    world.run(200);
    assert_eq!(speeds(&world), SPEEDS);
}

#[test]
fn an_arm_that_restarts_during_a_hold_has_the_speeds_of_power_up() {
    for millis in [10, 500, 6_000] {
        let mut world = moving_world();
        world.loses_replies = true;
        begin_hold(&mut world, Way::Command);
        world.run(300);
        world.power_cycle();
        world.loses_requests = true;
        world.run(millis);
        (world.loses_replies, world.loses_requests) = (false, false);
        world.run(2_000);
        assert_eq!(speeds(&world), SPEED.default_bytes(), "{millis} ms");
        assert!(!world.hub.is_holding());
    }
}

/// The port is lost in the middle of a hold, and the arm stays slow until the port is open again.
#[test]
fn a_hold_that_an_outage_interrupted_is_done_anew() {
    let mut world = moving_world();
    world.loses_replies = true;
    begin_hold(&mut world, Way::Command);
    world.run(200);
    world.unplug();
    world.run(1_000);
    world.loses_replies = false;
    world.plug();
    world.run(1_000);
    assert_eq!(speeds(&world), SPEEDS);
    assert!(position(&world) < 15_000);
    world.run(3_000);
    assert_eq!(world.arm.registers().get(MOVING_JOINTS.address), 0);
    assert!(position(&world) < 15_000, "it rests on its way");
}

/// A program that stops the arm remembers the speeds which it reads, and restores them later.
#[test]
fn a_program_reads_its_speeds_and_not_those_of_the_brake() {
    let mut world = moving_world();
    for steps in 0..200 {
        world.take(1);
        begin_hold(&mut world, Way::Command);
        world.send(1, &read(SPEED.address, 7));
        world.advance(steps);
        world.send(1, &read(SPEED.address, 7));
        world.run(50);
        let replies = world.take(1);
        assert!(!replies.is_empty() && replies.iter().all(|(_, values)| *values == SPEEDS), "{replies:?}");
    }
    world.loses_replies = true;
    begin_hold(&mut world, Way::Command);
    world.run(200);
    world.send(1, &write(SPEED.address, &[33]));
    world.run(200);
    assert_eq!(speeds(&world)[0], 1, "the brake is repeated");
    world.loses_replies = false;
    world.run(500);
    assert_eq!(speeds(&world)[..2], [33, 90]);
}

/// The hold reads the speeds and restores them. A program writes one again and again meanwhile.
#[test]
fn a_speed_that_a_program_writes_during_a_hold_is_kept() {
    let mut world = moving_world();
    for steps in 0..250_u8 {
        begin_hold(&mut world, Way::Command);
        let (joint, speed) = (steps % 7, 2 + steps % 90);
        for _ in 0..steps / 10 {
            world.send(0, &write(SPEED.address + joint, &[speed + 1]));
            world.advance(10);
        }
        world.advance((steps % 10).into());
        world.send(0, &write(SPEED.address + joint, &[speed]));
        world.run(60);
        assert!(!world.hub.is_holding());
        assert_eq!(speeds(&world)[usize::from(joint)], speed, "{steps} steps of 0.1 ms after the hold began");
        assert!(speeds(&world).iter().all(|&speed| speed != 1));
    }
}

/// Program 0 sets a set-point period of 20 ms, and sends one point for joint 1.
fn streaming_world() -> World {
    let mut world = moving_world();
    let target = 16_000_u16.to_le_bytes();
    world.send(0, &[write(SET_POINT_PERIOD.address, &PERIOD), write(FINE_TARGET.address, &target)].concat());
    world.run(20);
    world
}

fn period(world: &World) -> Vec<u8> {
    world.arm.registers().read(SET_POINT_PERIOD.address, SET_POINT_PERIOD.count).to_vec()
}

/// The two frames that restore what the hold changed.
fn restoring_frames() -> [Vec<u8>; 2] {
    [write(SET_POINT_PERIOD.address, &PERIOD), write(SPEED.address, &SPEEDS)]
}

#[test]
fn what_a_hold_restores_is_read_back_and_written_again() {
    for way in WAYS {
        for frame in restoring_frames() {
            let mut world = streaming_world();
            world.damaged_frame = (frame, 5);
            begin_hold(&mut world, way);
            while world.damaged_frame.1 > 0 {
                world.take(1);
                world.send(1, &read(SET_POINT_PERIOD.address, 2));
                world.run(5);
                let replies = world.take(1);
                assert!(replies.iter().all(|(_, values)| *values == PERIOD), "{way:?} {replies:?}");
            }
            world.run(200);
            assert_eq!((period(&world), speeds(&world)), (PERIOD.to_vec(), SPEEDS.to_vec()), "{way:?}");
            assert_eq!(world.hub.hold_outcome(), Some(HoldOutcome::Holds), "{way:?}");
            assert_eq!(world.hub.take_failed_hold(), None);
        }
    }
}

#[test]
fn a_hold_that_cannot_restore_what_it_changed_is_told() {
    for frame in restoring_frames() {
        let mut world = streaming_world();
        world.damaged_frame = (frame, usize::MAX);
        begin_hold(&mut world, Way::Page);
        world.run(1_000);
        assert_eq!(world.hub.hold_outcome(), Some(HoldOutcome::NotRestored));
        assert_eq!(world.hub.take_failed_hold(), Some(HoldOutcome::NotRestored));
        assert!(world.pages[0].answers[0].1.contains("did not take back"), "{:?}", world.pages[0].answers);
        world.damaged_frame.1 = 0;
        begin_hold(&mut world, Way::Command);
        world.run(200);
        assert_eq!(world.hub.hold_outcome(), Some(HoldOutcome::Holds), "the next hold restores it");
        assert_eq!((period(&world), speeds(&world)), (PERIOD.to_vec(), SPEEDS.to_vec()));
    }
}

/// The port is lost after the targets were written, and before the period is restored.
#[test]
fn a_period_that_an_outage_kept_from_the_arm_is_restored() {
    let mut world = streaming_world();
    world.damaged_frame = (restoring_frames()[0].clone(), usize::MAX);
    begin_hold(&mut world, Way::Command);
    world.run(40);
    world.unplug();
    world.run(1_000);
    world.damaged_frame.1 = 0;
    world.plug();
    world.run(1_000);
    assert_eq!((period(&world), speeds(&world)), (PERIOD.to_vec(), SPEEDS.to_vec()));
}

/// Replies are lost from each step of the first hold on, also from its last ones, which restore the speeds.
#[test]
fn a_stop_slows_the_joints_down_at_each_step_of_a_hold_before_it() {
    for steps in (0..400).step_by(3) {
        let mut world = moving_world();
        begin_hold(&mut world, Way::Command);
        world.advance(steps);
        world.loses_replies = true;
        world.run(10);
        let moves =
            [write(COMMAND, &[2]), write(SPEED.address, &SPEEDS), write(TARGET_POSITION.address, &[170])];
        world.send(0, &moves.concat());
        world.run(30);
        begin_hold(&mut world, Way::Command);
        world.run(110);
        assert_eq!(speeds(&world), [1; 7], "{steps} steps of 0.1 ms after the first hold began");
    }
}

#[test]
fn a_hold_is_confirmed_whatever_is_lost() {
    for seed in 0..30_u64 {
        let mut world = moving_world();
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        begin_hold(&mut world, WAYS[usize::try_from(seed % 3).unwrap()]);
        for _ in 0..300 {
            world.loses_replies = random.next_u64() % 2 == 0;
            world.loses_requests = random.next_u64() % 3 == 0;
            world.run(2 + random.next_u64() % 10);
        }
        (world.loses_replies, world.loses_requests) = (false, false);
        world.run(500);
        assert_eq!(speeds(&world), SPEEDS, "seed {seed}");
        let held = position(&world);
        world.run(2_000);
        assert!((position(&world) - held).abs() <= 60, "seed {seed}: it moves on from {held}");
        assert!(held < 15_900, "seed {seed}: on its way: {held}");
    }
}

#[test]
fn the_makers_stop_does_not_wait_for_the_commands_before_it() {
    for waiting in
        [r#"{"cmd":"read","id":54,"num":7}"#, r#"{"cmd":"IK6","pos":[0,250,100],"vec56":[0,0,-1]}"#]
    {
        let mut world = moving_world();
        world.loses_replies = true;
        world.send_message(0, waiting);
        world.run(30);
        for message in [r#"{"cmd":"angle","id":0,"angle":165}"#, r#"{"cmd":"ping"}"#, r#"{"cmd":"stop"}"#] {
            world.send_message(0, message);
        }
        world.run(20);
        assert_eq!(speeds(&world), [1; 7], "{waiting}");
        assert_ne!(world.arm.registers().get(TARGET_POSITION.address), 165);
        world.loses_replies = false;
        world.run(4_000);
        let answers: Vec<_> = world.pages[0].answers.iter().map(|(_, answer)| answer.as_str()).collect();
        let expected = ["", "A stop came after this command", "pong", "Stopped"];
        assert_eq!(answers.len(), expected.len(), "{answers:?}");
        assert!(answers.iter().zip(expected).all(|(answer, text)| answer.contains(text)), "{answers:?}");
        assert_ne!(world.arm.registers().get(TARGET_POSITION.address), 165);
        assert_eq!(speeds(&world), SPEEDS);
    }
}

/// The reads get no replies, so of the queue only the stop is carried out meanwhile.
#[test]
fn the_makers_stop_is_carried_out_however_many_commands_wait() {
    for waiting in [19, 20, 21, 400] {
        let mut world = moving_world();
        world.loses_replies = true;
        (0..waiting).for_each(|_| world.send_message(0, r#"{"cmd":"read","id":54,"num":7}"#));
        world.run(30);
        for message in [r#"{"cmd":"angle","id":0,"angle":165}"#, r#"{"cmd":"stop"}"#] {
            world.send_message(0, message);
        }
        world.run(20);
        assert_eq!(speeds(&world), [1; 7], "{waiting} commands wait");
        world.loses_replies = false;
        world.run(5_000);
        assert_eq!(speeds(&world), SPEEDS);
        assert_ne!(world.arm.registers().get(TARGET_POSITION.address), 165);
        let answers: Vec<_> = world.pages[0].answers.iter().map(|(_, answer)| answer.as_str()).collect();
        assert_eq!(answers.len(), waiting + 2, "each command is answered");
        assert!(answers.last().is_some_and(|answer| answer.contains("Stopped")), "{answers:?}");
        let refused = answers.iter().filter(|answer| answer.contains("Too many commands wait")).count();
        assert_eq!(refused > 0, waiting > 200, "{refused} refused");
    }
}
