//! Obstacles of an arm: walls, hands, a thing between the claws. How servos protect themselves.

use crate::rig::{Rig, near};
use arm_sim::plant::{Thing, Wall};
use arm_sim::servo::Trip;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{error, read, register, write};
use protocol_core::registers::{JOINTS, Joint};

const BASE: Joint = Joint::ALL[0];
const FOREARM: Joint = Joint::ALL[2];
const CLAW: Joint = Joint::ALL[6];
const STANDARD: [u16; JOINTS] = [511, 445, 684, 511, 512, 512, 1_008];

/// Moves the base to a position, with the other joints in the standard pose.
fn turn_base(rig: &mut Rig, counts: u16) {
    rig.all_goals([counts, 445, 684, 511, 512, 512, 1_008]);
}

fn set_claw(rig: &mut Rig, counts: u16) {
    rig.all_goals([511, 445, 684, 511, 512, 512, counts]);
}

const fn wall(degrees: i32, stiffness: Option<u16>) -> Option<Wall> {
    Some(Wall { millidegrees: degrees * 1_000, stiffness })
}

/// Did the forearm rise to this goal? A weight of 459 mN m and a friction of 123 mN m leave it at most 4.8 counts below the goal.
fn is_lifted(rig: &Rig, goal: u16) -> bool {
    (0..=5).contains(&goal.saturating_sub(rig.counts(FOREARM)))
}

fn errors(rig: &mut Rig, joint: Joint) -> u8 {
    rig.reading(joint).unwrap().1
}

/// Sets a register of a joint's servo, with its EEPROM unlocked.
fn set(rig: &mut Rig, joint: Joint, register: u8, value: u8) {
    for (register, value) in [(register::LOCK, 0), (register, value), (register::LOCK, 1)] {
        rig.ask(|b| write(b, joint.index(), register, &[value]));
    }
}

#[test]
fn a_wall_is_free_before_it_holds_at_it_and_lets_go() {
    for (degrees, before, beyond) in [(100, 535, 583), (80, 487, 439)] {
        let mut rig = Rig::driven();
        rig.plant.set_wall(BASE, wall(degrees, None));
        turn_base(&mut rig, before);
        rig.pass(500);
        assert_eq!(rig.plant.wall_count(BASE).effects, 0, "free before the wall");
        turn_base(&mut rig, beyond);
        rig.pass(500);
        assert_eq!(rig.plant.angle(BASE), degrees * 1_000);
        assert_eq!(rig.plant.load(BASE).abs(), 1_000, "5 degrees beyond the wall");
        let touched = rig.plant.wall_count(BASE);
        assert!(touched.effects > 300 && touched.effects < touched.occasions, "{touched:?}");
        rig.plant.set_wall(BASE, None);
        rig.pass(500);
        assert!(near(rig.counts(BASE), beyond), "it was released");
    }
}

#[test]
fn a_joint_turns_away_from_its_wall() {
    let mut rig = Rig::driven();
    rig.plant.set_wall(BASE, wall(90, None));
    turn_base(&mut rig, 560);
    rig.pass(500);
    let here = rig.plant.angle(BASE);
    turn_base(&mut rig, 400);
    rig.pass(500);
    assert!(here <= 90_000 && near(rig.counts(BASE), 400), "{here}");
}

#[test]
fn a_soft_wall_gives_way() {
    let mut rig = Rig::driven();
    // 570 mN m per degree, which is the stiffness of the servo.
    rig.plant.set_wall(BASE, wall(95, Some(570)));
    turn_base(&mut rig, 511 + 24 + 14);
    rig.pass(2_000);
    let depth = rig.plant.angle(BASE) - 95_000;
    assert!((1_300..1_700).contains(&depth), "half of 3 degrees: {depth}");
}

#[test]
fn a_wall_stops_a_fall_and_a_hand() {
    let mut rig = Rig::driven();
    rig.plant.set_wall(FOREARM, wall(90, None));
    rig.plant.set_wall(BASE, wall(100, None));
    rig.all_torque(Torque::Free);
    rig.plant.push(BASE, 300);
    rig.pass(3_000);
    assert_eq!([rig.plant.angle(FOREARM), rig.plant.angle(BASE)], [90_000, 100_000]);
    rig.plant.push(BASE, 0);
    rig.plant.set_wall(FOREARM, None);
    assert!(rig.turn_in(300)[2] > 1_000);
}

#[test]
fn a_hand_pushes_towards_greater_angles() {
    for joint in Joint::ALL {
        for torque in [500, -500] {
            let mut rig = Rig::driven();
            let before = rig.plant.angle(joint);
            rig.plant.push(joint, torque);
            rig.pass(500);
            let pushed = (rig.plant.angle(joint) - before) * i32::from(torque.signum());
            assert!(pushed > 200, "joint {}: {pushed}", joint.number());
            rig.plant.push(joint, 0);
            rig.pass(500);
            // Friction holds up to 123 mN m in each direction, so two positions at rest differ by up to 246 mN m. With the stall
            // torque of 2450 mN m at 4.3 degrees of error, this is 0.43 degrees.
            let left = rig.plant.angle(joint) - before;
            assert!(left.abs() < 440, "joint {}: {left}", joint.number());
            assert_eq!(rig.plant.push_count(joint).effects, 0, "a new push counts anew");
        }
    }
}

#[test]
fn claws_close_on_a_thing_and_drop_it_when_they_open() {
    let mut rig = Rig::driven();
    rig.plant.set_thing(Some(Thing { millidegrees: 30_000, stiffness: None }));
    rig.plant.set_load(200);
    rig.pass(1_000);
    assert!(rig.plant.has_thing(), "open claws drop nothing that they have not touched");
    set_claw(&mut rig, 830);
    rig.pass(1_000);
    assert_eq!(rig.plant.angle(CLAW), 30_000);
    assert!(rig.plant.load(CLAW) < -250, "{}", rig.plant.load(CLAW));
    set_claw(&mut rig, 838);
    rig.pass(1_000);
    assert!(rig.plant.has_thing() && rig.plant.load_grams() == 200, "a degree is no drop");
    set_claw(&mut rig, 1_000);
    rig.pass(1_000);
    assert!(!rig.plant.has_thing() && rig.plant.load_grams() == 0);
    set_claw(&mut rig, 760);
    rig.pass(1_000);
    assert!(near(rig.counts(CLAW), 760), "nothing is between the claws");
}

#[test]
fn a_soft_thing_is_pressed_and_can_be_dropped() {
    let mut rig = Rig::driven();
    rig.plant.set_thing(Some(Thing { millidegrees: 30_000, stiffness: Some(137) }));
    rig.plant.set_load(50);
    set_claw(&mut rig, 820);
    rig.pass(2_000);
    // The goal is 4.1 degrees beyond the thing. The servo has the stiffness of the thing: 588 mN m in 4.3 degrees, which is
    // 137 mN m per degree. So the claws stop halfway.
    let depth = 30_000 - rig.plant.angle(CLAW);
    assert!((1_900..2_200).contains(&depth), "{depth}");
    assert!(rig.plant.thing_count().effects > 500);
    rig.plant.drop_thing();
    rig.pass(1_000);
    assert!(near(rig.counts(CLAW), 820) && rig.plant.load_grams() == 0);
}

#[test]
fn a_blocked_joint_trips_after_a_second_and_latches() {
    for (error_counts, trips) in [(16, false), (17, true)] {
        let mut rig = Rig::driven();
        rig.plant.set_wall(BASE, wall(90, None));
        rig.pass(1);
        // An overload is a torque above 80 % of the stall torque. An error of 20.3 counts gives the stall torque, 16.2 counts
        // 80 %.
        turn_base(&mut rig, 511 + error_counts);
        rig.pass(990);
        assert_eq!(errors(&mut rig, BASE), 0, "not before a second");
        rig.pass(100);
        assert_eq!(errors(&mut rig, BASE) != 0, trips, "{error_counts} counts");
        rig.pass(3_000);
        assert_eq!(errors(&mut rig, BASE) != 0, trips, "{error_counts} counts");
    }
}

#[test]
fn a_latched_overload_frees_the_joint_until_torque_is_cycled() {
    let mut rig = Rig::driven();
    rig.plant.trip(FOREARM, Trip::Overload);
    assert!(rig.turn_in(300)[2] > 10_000, "it falls");
    assert_eq!(errors(&mut rig, FOREARM), error::OVERLOAD);
    let (answer, _) = rig.ask(|b| read(b, FOREARM.index(), register::TORQUE_SWITCH, 1));
    assert_eq!(answer[4..6], [error::OVERLOAD, 1], "register 40 reads what was written");
    rig.all_goals(STANDARD);
    rig.torque(FOREARM, 1);
    assert!(!rig.plant.has_torque(FOREARM));
    rig.torque(FOREARM, 0);
    rig.torque(FOREARM, 1);
    rig.pass(1_000);
    assert_eq!(errors(&mut rig, FOREARM), 0);
    assert!(is_lifted(&rig, 684), "it is back at its goal");
}

#[test]
fn a_forced_overload_needs_torque() {
    let mut rig = Rig::ready();
    rig.plant.trip(BASE, Trip::Overload);
    rig.pass(10);
    assert_eq!(errors(&mut rig, BASE), 0);
}

#[test]
fn fast_motion_is_no_overload() {
    let mut rig = Rig::driven();
    rig.plant.set_load(300);
    for round in 0..20 {
        let (base, claw) = if round % 2 == 0 { (1_023, 730) } else { (0, 1_023) };
        rig.all_goals([base, 445, 684, base, 512, base, claw]);
        rig.pass(700);
        assert!(Joint::ALL.into_iter().all(|joint| rig.plant.has_torque(joint)), "round {round}");
    }
}

#[test]
fn heat_frees_a_joint_until_it_has_cooled_down_and_then_it_swings_to_its_goal() {
    let mut rig = Rig::driven();
    rig.plant.trip(FOREARM, Trip::Heat);
    rig.pass(2_000);
    let (reading, errors) = rig.reading(FOREARM).unwrap();
    assert_eq!((errors, reading.load), (error::OVERHEAT, 0));
    assert!(reading.temperature_celsius > 80);
    assert!(!rig.plant.has_torque(FOREARM) && rig.plant.angle(FOREARM) > 100_000, "it falls");
    rig.all_goals([511, 445, 500, 511, 512, 512, 1_008]);
    rig.pass(2_000);
    assert!(rig.counts(FOREARM) < 500, "it does not obey");
    rig.pass(30_000);
    let (reading, errors) = rig.reading(FOREARM).unwrap();
    assert_eq!((errors, reading.temperature_celsius < 81), (0, true));
    assert!(is_lifted(&rig, 500), "torque came back, towards the stored goal");
}

#[test]
fn a_stalled_servo_overheats_if_its_overload_does_not_stop_it() {
    let mut rig = Rig::driven();
    // Heat switches the motor off; an overload does not.
    set(&mut rig, BASE, register::UNLOAD_CONDITIONS, error::OVERHEAT);
    rig.plant.set_wall(BASE, wall(90, None));
    turn_base(&mut rig, 700);
    rig.pass(90_000);
    assert_eq!((errors(&mut rig, BASE), rig.plant.has_torque(BASE)), (error::OVERLOAD, true));
    rig.pass(15_000);
    assert_eq!(errors(&mut rig, BASE), error::OVERLOAD | error::OVERHEAT);
    assert!(!rig.plant.has_torque(BASE));
}

#[test]
fn register_19_tells_which_alarms_free_a_joint() {
    for (mask, bit) in [(0, 0), (error::VOLTAGE, error::VOLTAGE), (0x25, error::VOLTAGE)] {
        let mut rig = Rig::driven();
        set(&mut rig, FOREARM, register::UNLOAD_CONDITIONS, mask);
        rig.plant.set_supply_fault(Some("volts=4.8".parse().unwrap()));
        rig.pass(1_000);
        assert_eq!(errors(&mut rig, FOREARM), error::VOLTAGE);
        assert_eq!(rig.plant.has_torque(FOREARM), bit == 0, "{mask:#x}");
        rig.plant.set_supply_fault(None);
        rig.pass(1_000);
        assert!(rig.plant.has_torque(FOREARM) && errors(&mut rig, FOREARM) == 0);
        assert!(is_lifted(&rig, 684), "torque came back");
    }
}

#[test]
fn a_joint_that_holds_40_percent_for_an_hour_stays_below_its_limit() {
    let mut rig = Rig::driven();
    rig.plant.set_thing(Some(Thing { millidegrees: 30_000, stiffness: None }));
    // An error of 14.9 counts gives full duty, 6 counts 40 %. The claws touch the thing at 834 counts.
    set_claw(&mut rig, 828);
    (0..60).for_each(|_| rig.pass(60_000));
    let (reading, errors) = rig.reading(CLAW).unwrap();
    assert!((-440..-390).contains(&reading.load), "{}", reading.load);
    assert!(
        (55..65).contains(&reading.temperature_celsius) && errors == 0,
        "{}",
        reading.temperature_celsius
    );
}

#[test]
fn the_same_calls_give_the_same_bytes() {
    let run = |pause: u64| {
        let mut rig = Rig::driven();
        rig.plant.set_wall(BASE, wall(100, Some(800)));
        rig.plant.push(FOREARM, -400);
        rig.plant.set_thing(Some(Thing { millidegrees: 30_000, stiffness: Some(100) }));
        rig.plant.set_load(300);
        rig.all_goals([700, 500, 600, 600, 600, 600, 800]);
        (0..840 / pause).for_each(|_| rig.pass(pause));
        rig.plant.trip(Joint::ALL[1], Trip::Overload);
        (0..840 / pause).for_each(|_| rig.pass(pause));
        Joint::ALL.map(|joint| {
            let (bytes, _) = rig.ask(|b| read(b, joint.index(), register::PRESENT_POSITION, 15));
            bytes
        })
    };
    let first = run(1);
    assert_eq!([run(1), run(7), run(840)], [first.clone(), first.clone(), first]);
}
