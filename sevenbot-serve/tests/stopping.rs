//! A stop goes before everything else, and ends the streams of other clients. A request that is late, or whose
//! sender's connection broke, is not carried out.
//!
//! `SERVE_STOPS` sets the number of stops beside each attack; 1000 take some minutes.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

mod rig;

use protocol_core::registers::map::{
    CHIP_ID, FINE_TARGET, HOST_WATCHDOG, LIMITS, MOTOR_STATE, PRESENT_POSITION, SPEED, TARGET_POSITION,
};
use protocol_core::time::Duration;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use rig::{World, read, sharing, write};
use sevenbot_serve::hub::HubOptions;

const SEED: u64 = 25;
const COMMAND: u8 = 239;
/// The largest distance by which the weight draws a joint off its target, in hundredths of a degree.
const DROOP: i32 = 150;

fn targets(world: &World) -> Vec<u8> {
    world.arm.registers().read(FINE_TARGET.address, FINE_TARGET.count).to_vec()
}

/// The fine targets and positions as program 1 reads them. The arm brings these registers up to date when they are read.
fn look(world: &mut World) -> (Vec<u8>, [i32; 7]) {
    world.round_trip(1, &read(FINE_TARGET.address, 28));
    let (_, values) = world.take(1).pop().expect("a reply");
    let position = |joint: usize| u16::from_le_bytes([values[14 + 2 * joint], values[15 + 2 * joint]]);
    (values[..14].to_vec(), std::array::from_fn(|joint| position(joint).into()))
}

fn positions(world: &mut World) -> [i32; 7] {
    look(world).1
}

/// A program stops the arm: it reads the positions, and writes them as targets. Returns the time until the write reached the
/// arm, and the targets.
fn stop(world: &mut World, program: usize) -> (Duration, Vec<u8>) {
    world.round_trip(program, &read(FINE_TARGET.address, 28));
    let (_, values) = world.take(program).pop().expect("a reply");
    let held = values[14..].to_vec();
    world.send(program, &write(FINE_TARGET.address, &held));
    let start = world.now;
    while targets(world) != held {
        world.advance(1);
        assert!(world.now - start < Duration::from_millis(500), "the stop did not reach the arm");
    }
    (world.now - start, held)
}

/// The greatest distance between the position of a joint and its fine target, in hundredths of a degree.
fn farthest(targets: &[u8], positions: [i32; 7]) -> i32 {
    let targets = targets.chunks(2).map(|word| i32::from(u16::from_le_bytes([word[0], word[1]])));
    targets.zip(positions).map(|(target, position)| (target - position).abs()).max().unwrap()
}

/// What the other clients of the server do while the arm is told to stop.
#[derive(Clone, Copy, Debug)]
enum Attack {
    Nothing,
    Readers,
    LongWrites,
    Targets,
    Stops,
    /// A program sets a watchdog of 10 ms, and is silent for 40 ms of each 50 ms.
    Watchdogs,
}

const ATTACKERS: usize = 31;

impl Attack {
    fn refill(self, world: &mut World, turn: u64) {
        let request = match self {
            Self::Nothing => return,
            Self::Readers => read(0, 255),
            Self::LongWrites => write(0, &[0; 255]),
            Self::Targets => write(TARGET_POSITION.address, &[u8::try_from(turn % 100).unwrap() + 40]),
            Self::Stops => write(MOTOR_STATE.address, &[1]),
            Self::Watchdogs => {
                if (world.now.as_micros() / 10_000).is_multiple_of(5) {
                    world.send(2, &write(HOST_WATCHDOG.address, &[1]));
                }
                return;
            }
        };
        for attacker in 2..2 + ATTACKERS {
            while world.programs[attacker].to_send_bytes() < 600 {
                world.send(attacker, &request);
            }
        }
    }
}

/// Stops the arm at random moments while program 0 streams. After a stop the arm brakes, and comes to rest where it was stopped.
fn stop_often(attack: Attack) {
    let times: u64 = std::env::var("SERVE_STOPS").map_or(8, |text| text.parse().expect("a number"));
    let mut world = World::new(2 + ATTACKERS);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut delays = Vec::new();
    world.send(0, &write(SPEED.address, &[100; 7]));
    for turn in 0..times {
        let goal = if turn % 2 == 0 { 40 } else { 140 };
        world.send(0, &[write(COMMAND, &[2]), write(TARGET_POSITION.address, &[goal])].concat());
        for _ in 0..1 + random.next_u64() % 20 {
            world.send(0, &write(TARGET_POSITION.address, &[goal]));
            attack.refill(&mut world, turn);
            world.advance(20 + random.next_u64() % 100);
        }
        let (delay, held) = stop(&mut world, 1);
        delays.push(delay.as_micros());
        for settling in 0..14 {
            let before = positions(&mut world);
            for _ in 0..4 {
                world.send(0, &write(TARGET_POSITION.address, &[goal]));
                attack.refill(&mut world, turn);
                world.advance(50);
            }
            let (targets, after) = look(&mut world);
            assert_eq!(targets, held, "{attack:?}, stop {turn}: nothing moves it");
            let moved = before.iter().zip(after).map(|(before, after)| (before - after).abs()).max().unwrap();
            assert!(settling < 10 || moved <= 30, "{attack:?}, stop {turn}: moved by {moved} hundredths");
        }
        let off = farthest(&held, positions(&mut world));
        assert!(off <= DROOP, "{attack:?}, stop {turn}: rests {off} hundredths from where it was stopped");
    }
    delays.sort_unstable();
    let (p50, p99) = (delays[delays.len() / 2], delays[delays.len() * 99 / 100]);
    println!(
        "{attack:?}: {times} stops, seed {SEED}: p50 {p50} us, p99 {p99} us, at most {:?} us",
        delays.last()
    );
    assert!(p99 <= 20_000, "{attack:?}: p99 {p99} us");
}

#[test]
fn a_stop_reaches_the_arm_at_once_and_nothing_moves_it_afterwards() {
    stop_often(Attack::Nothing);
}

#[test]
fn a_stop_reaches_the_arm_beside_readers_of_long_replies() {
    stop_often(Attack::Readers);
}

#[test]
fn a_stop_reaches_the_arm_beside_long_writes() {
    stop_often(Attack::LongWrites);
}

#[test]
fn a_stop_reaches_the_arm_beside_others_that_stream() {
    stop_often(Attack::Targets);
}

#[test]
fn a_stop_reaches_the_arm_beside_others_that_switch_the_motors_on() {
    stop_often(Attack::Stops);
}

#[test]
fn a_stop_holds_the_arm_where_it_was_beside_watchdogs_that_act() {
    stop_often(Attack::Watchdogs);
}

#[test]
fn what_a_stop_ended_starts_anew_after_a_pause_and_is_told() {
    let mut world = World::new(2);
    world.send(0, &write(TARGET_POSITION.address, &[120]));
    world.run(50);
    assert_eq!(sharing(&mut world, 0), [1, 2, 1, 0, 0, 0, 0, 0], "it drives");
    assert_eq!(sharing(&mut world, 1), [1, 2, 2, 0, 0, 0, 0, 0], "another one drives");
    let (_, held) = stop(&mut world, 1);
    for _ in 0..30 {
        world.send(0, &write(TARGET_POSITION.address, &[120]));
        world.run(50);
    }
    assert_eq!(targets(&world), held);
    assert_eq!(sharing(&mut world, 0), [1, 2, 0, 1, 1, 30, 0, 0], "stopped, and 30 writes dropped");
    world.run(1_000);
    world.send(0, &write(TARGET_POSITION.address, &[120]));
    world.run(20);
    assert_eq!(world.arm.registers().get(TARGET_POSITION.address), 120);
}

#[test]
fn a_command_to_the_server_stops_the_arm_and_ends_streams() {
    let mut world = World::new(2);
    world.send(0, &write(TARGET_POSITION.address, &[150]));
    world.run(300);
    world.send(1, &write(COMMAND, &[1]));
    world.send(0, &write(TARGET_POSITION.address, &[150]));
    world.run(20);
    let held = world.arm.registers().get(TARGET_POSITION.address);
    assert!((91..149).contains(&held), "on its way: {held}");
    world.send(0, &write(TARGET_POSITION.address, &[150]));
    world.run(200);
    assert_eq!(world.arm.registers().get(TARGET_POSITION.address), held);
}

/// The weight draws the joints off their targets. If a hold wrote the positions as targets, the arm would sink by this
/// distance each time.
#[test]
fn d24_an_arm_that_is_held_again_and_again_does_not_sink() {
    let mut world = World::new(3);
    world.send(0, &write(TARGET_POSITION.address, &[60, 40, 65]));
    world.run(3_000);
    let before = look(&mut world);
    let droop =
        before.0.chunks(2).zip(before.1).map(|(target, position)| {
            (i32::from(u16::from_le_bytes([target[0], target[1]])) - position).abs()
        });
    assert!(droop.max() > Some(20), "the weight acts: {before:?}");
    for turn in 0..40 {
        world.send(1, &write(COMMAND, &[1]));
        // A watchdog of 10 ms, and then silence.
        world.send(2, &write(HOST_WATCHDOG.address, &[1]));
        world.run(25);
        assert_eq!(look(&mut world).0, before.0, "hold {turn}");
    }
    let moved =
        before.1.iter().zip(positions(&mut world)).map(|(before, after)| (before - after).abs()).max();
    assert!(moved <= Some(10), "moved by {moved:?} hundredths");
}

/// A hold reads the positions, and writes them as targets. In between, at each moment in turn, a program stops the arm.
#[test]
fn a_hold_under_way_does_not_overwrite_a_stop_that_comes_meanwhile() {
    let mut world = World::new(3);
    world.send(0, &write(SPEED.address, &[100; 7]));
    for steps in (0..150).step_by(2) {
        let goal = if steps % 4 == 0 { 40 } else { 140 };
        world.send(0, &[write(COMMAND, &[2]), write(TARGET_POSITION.address, &[goal])].concat());
        world.run(200);
        world.round_trip(2, &read(FINE_TARGET.address, 28));
        let (_, values) = world.take(2).pop().expect("a reply");
        world.send(1, &write(COMMAND, &[1]));
        world.advance(steps);
        world.send(2, &write(FINE_TARGET.address, &values[14..]));
        world.run(100);
        assert_eq!(targets(&world), values[14..], "{steps} steps of 0.1 ms after the hold began");
    }
}

/// A joint that got a target soon after power-up moves as soon as it is measured. Until then no position is known at which it
/// could hold.
#[test]
fn a_command_stops_an_arm_that_was_just_switched_on() {
    for delay in (50..300).step_by(10) {
        let mut world = World::new(2);
        world.power_cycle();
        world.run(delay);
        world.send(0, &write(TARGET_POSITION.address, &[150]));
        world.run(20);
        world.send(1, &write(COMMAND, &[1]));
        world.run(2_000);
        let held = world.arm.registers().get(TARGET_POSITION.address);
        assert!(held < 145, "{delay} ms after power-up: on its way to {held}");
    }
}

/// Each command begins another hold before the previous one has ended.
#[test]
fn commands_without_a_pause_stop_the_arm() {
    let mut world = World::new(4);
    world.send(0, &write(TARGET_POSITION.address, &[150]));
    world.run(300);
    for _ in 0..100 {
        (1..4).for_each(|program| world.send(program, &write(COMMAND, &[1])));
        world.run(2);
    }
    let held = world.arm.registers().get(TARGET_POSITION.address);
    assert!((91..149).contains(&held), "on its way: {held}");
    world.run(500);
    assert_eq!(world.arm.registers().get(TARGET_POSITION.address), held);
}

/// With a set-point period, a fine target is the next point of a stream. The joint may reach it two periods later: 2 s here.
#[test]
fn a_command_stops_a_stream_with_a_long_period() {
    let mut world = World::new(2);
    world.send(0, &write(184, &1_000_u16.to_le_bytes()));
    world.send(0, &write(FINE_TARGET.address, &14_000_u16.to_le_bytes()));
    world.run(700);
    world.send(1, &write(COMMAND, &[1]));
    world.run(200);
    let before = positions(&mut world);
    world.run(500);
    assert!(positions(&mut world)[0].abs_diff(before[0]) <= 30, "{before:?} {:?}", positions(&mut world));
    assert_eq!(world.arm.registers().read(184, 2), 1_000_u16.to_le_bytes(), "the period stays");
}

#[test]
fn a_flood_of_a_client_that_is_gone_moves_nothing() {
    for is_reset in [false, true] {
        let mut world = World::new(2);
        for turn in 0..3_000_u32 {
            let value = u8::try_from(turn % 100).unwrap() + 40;
            world.send(0, &write(TARGET_POSITION.address, &[value, value]));
        }
        world.run(300);
        if is_reset {
            world.reset(0);
        } else {
            world.leave(0);
        }
        world.run(if is_reset { 5 } else { 200 });
        let before = targets(&world);
        world.run(2_000);
        assert_eq!(targets(&world), before);
    }
}

#[test]
fn what_a_client_wrote_directly_before_it_left_is_carried_out() {
    for count in 1..=10_u8 {
        let mut world = World::new(1);
        for value in 1..=count {
            world.send(0, &write(SPEED.address, &[value]));
        }
        world.send(0, &write(TARGET_POSITION.address, &[100 + count]));
        world.push();
        world.leave(0);
        world.run(100);
        let registers = world.arm.registers();
        assert_eq!(
            (registers.get(SPEED.address), registers.get(TARGET_POSITION.address)),
            (count, 100 + count)
        );
    }
}

/// No reply of the arm arrives whole for half a second, so the target waits behind its program's read.
#[test]
fn a_target_that_waited_too_long_is_dropped() {
    let mut world = World::new(2);
    world.send(0, &read(CHIP_ID.address, 6));
    world.send(0, &[write(TARGET_POSITION.address, &[120]), write(SPEED.address, &[7])].concat());
    for _ in 0..500 {
        world.damages_next_byte = true;
        world.run(1);
    }
    world.run(1_500);
    let registers = world.arm.registers();
    assert_eq!((registers.get(TARGET_POSITION.address), registers.get(SPEED.address)), (90, 7));
    assert_eq!(sharing(&mut world, 0)[5], 1, "it is told");
}

#[test]
fn a_short_read_beside_31_readers_of_long_replies_takes_at_most_100_ms() {
    let mut world = World::new(33);
    let mut times: Vec<u64> = (0..60)
        .map(|turn| {
            Attack::Readers.refill(&mut world, 0);
            world.advance(turn * 7 % 50);
            world.round_trip(1, &read(PRESENT_POSITION.address, 7)).as_micros()
        })
        .collect();
    times.sort_unstable();
    println!("p50 {} us, at most {:?} us", times[30], times.last());
    assert!(times[30] <= 100_000, "{times:?}");
}

#[test]
fn with_one_driver_the_others_watch_until_it_pauses_or_hands_over() {
    let options = HubOptions { has_one_driver: true, ..HubOptions::default() };
    let mut world = World::with_options(2, options);
    let target = |world: &World| world.arm.registers().get(TARGET_POSITION.address);
    let move_to = |world: &mut World, program, value| {
        world.send(program, &write(TARGET_POSITION.address, &[value]));
        world.run(20);
        target(world)
    };
    assert_eq!(move_to(&mut world, 0, 100), 100);
    assert_eq!(move_to(&mut world, 1, 110), 100);
    assert_eq!(sharing(&mut world, 1), [1, 2, 2, 0, 4, 1, 0, 0]);
    world.send(0, &write(COMMAND, &[3]));
    world.run(20);
    assert_eq!(move_to(&mut world, 1, 110), 110, "handed over");
    assert_eq!(move_to(&mut world, 0, 100), 110);
    let (_, held) = stop(&mut world, 0);
    assert_eq!(targets(&world), held, "a stop works whoever drives");
    world.run(1_000);
    assert_eq!(move_to(&mut world, 0, 100), 100, "the other one was silent");
}

#[test]
fn with_read_only_access_nothing_but_reads_is_sent() {
    let mut world = World::with_access(2, true);
    for request in [write(SPEED.address, &[7]), write(COMMAND, &[1]), read(13, 7), write(53, &[50])] {
        world.send(0, &request);
    }
    world.join_page();
    for message in [r#"{"cmd":"angle","id":0,"angle":80}"#, r#"{"cmd":"stop"}"#] {
        world.send_message(0, message);
    }
    world.run(1_000);
    let functions: Vec<u8> = world.sent.chunks(7).map(|frame| frame[2]).collect();
    assert!(functions.len() > 10 && functions.iter().all(|&function| function == 3), "{functions:?}");
    let answers: Vec<_> = world.pages[0].answers.iter().map(|(_, answer)| answer.as_str()).collect();
    assert!(answers.iter().all(|answer| answer.contains("read-only")) && answers.len() == 2, "{answers:?}");
    assert_eq!(sharing(&mut world, 0)[4], 2);
}

/// The maker's `stop`. Returns its answer.
fn makers_stop(world: &mut World) -> String {
    world.send_message(0, r#"{"cmd":"stop"}"#);
    let answer = (0..2_000).find_map(|_| {
        world.run(1);
        world.pages[0].answers.pop()
    });
    answer.expect("an answer").1
}

#[test]
fn m11_the_makers_stop_holds_each_joint_and_leaves_those_at_rest() {
    let mut world = World::new(2);
    world.join_page();
    world.run(1_000);
    let before = look(&mut world).0;
    (0..10).for_each(|_| assert!(makers_stop(&mut world).contains("Stopped")));
    assert_eq!(look(&mut world).0, before, "an arm that is stopped again and again does not sink");
    world.send(0, &write(SPEED.address, &[20; 7]));
    world.send(0, &write(TARGET_POSITION.address, &[150]));
    world.run(500);
    assert!(makers_stop(&mut world).contains("Stopped"));
    let held = look(&mut world).0;
    assert_eq!(held[2..], before[2..]);
    world.run(2_000);
    assert!(farthest(&held, positions(&mut world)) <= DROOP && positions(&mut world)[0] < 12_000);
}

#[test]
fn d25_each_stop_holds_an_arm_whose_joints_are_measured_outside_the_linkage() {
    for by_maker in [false, true] {
        let mut world = World::new(2);
        world.join_page();
        world.send(0, &write(TARGET_POSITION.address, &[90, 150, 76]));
        world.run(4_000);
        world.send(0, &write(SPEED.address, &[10; 7]));
        world.send(0, &write(LIMITS.address, &[1]));
        world.send(0, &write(TARGET_POSITION.address, &[10, 76, 150]));
        world.run(1_000);
        let measured = positions(&mut world);
        assert!(measured[1] + measured[2] > 22_600, "outside: {measured:?}");
        if by_maker {
            assert!(makers_stop(&mut world).contains("Stopped"));
        } else {
            world.send(1, &write(COMMAND, &[1]));
        }
        world.run(1_000);
        let held = positions(&mut world);
        world.run(2_000);
        let after = positions(&mut world);
        assert!(held.iter().zip(after).all(|(held, after)| held.abs_diff(after) < 30), "{held:?} {after:?}");
        assert!(after[0] > 5_000, "the others hold, too: {after:?}");
    }
}
