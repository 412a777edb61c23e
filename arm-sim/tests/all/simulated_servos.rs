//! The simulated servos as their master sees them: bytes on a wire, and time as an argument.

use crate::rig::{Rig, near};
use arm_sim::servo::ServoConfig;
use motion_core::servo_bus::frame::{ping, read, register, sync_write};
use motion_core::servo_bus::{Torque, TorqueCodes};
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::Duration;

const BASE: Joint = Joint::ALL[0];
/// The position of joint 1 in the standard pose.
const BASE_START: u16 = 511;

#[test]
fn the_arm_starts_in_the_standard_pose() {
    let rig = Rig::ready();
    // 90 90 65 90 90 90 80 degrees by the table of calibration.
    assert_eq!(Joint::ALL.map(|joint| rig.counts(joint)), [511, 445, 684, 511, 512, 512, 1_008]);
}

#[test]
fn answers_are_exact_and_take_their_time_on_the_wire() {
    let mut rig = Rig::ready();
    let (bytes, micros) = rig.ask(|b| ping(b, 0));
    assert_eq!(bytes, [0xFF, 0xFF, 0, 2, 0, 0xFD]);
    assert_eq!(micros, 60 + 250 + 60, "six bytes, the return delay, six bytes");
    let (bytes, micros) = rig.ask(|b| read(b, 6, register::PRESENT_POSITION, 8));
    // Position 1008, no speed, no load, 7.4 V, 25 degrees.
    assert_eq!(bytes, [0xFF, 0xFF, 6, 10, 0, 0x03, 0xF0, 0, 0, 0, 0, 74, 25, 0x99]);
    assert_eq!(micros, 80 + 250 + 140);
}

#[test]
fn bytes_arrive_one_by_one_and_a_question_may_be_in_pieces() {
    let mut rig = Rig::ready();
    for piece in [[0xFF, 0xFF, 0], [2, 1, 0xFC]] {
        rig.plant.bytes(rig.now, &piece);
    }
    let half_way = rig.now + Duration::from_micros(60 + 250 + 30);
    assert_eq!(rig.plant.poll(half_way), [0xFF, 0xFF, 0]);
    assert_eq!(rig.plant.poll(half_way + Duration::from_micros(30)), [2, 0, 0xFD]);
}

#[test]
fn servos_do_not_answer_until_they_have_started() {
    let mut rig = Rig::with(ServoConfig::default());
    rig.pass(199);
    assert_eq!(rig.ask(|b| ping(b, 0)).0, []);
    rig.pass(1);
    assert_eq!(rig.ask(|b| ping(b, 0)).0.len(), 6);
    rig.torque(BASE, 1);
    rig.goal(BASE, 600, 0, 0);
    rig.pass(500);
    rig.plant.power_cycle(rig.now);
    assert!(rig.reading(BASE).is_none());
    rig.pass(200);
    assert_eq!(rig.reading(BASE).map(|(reading, _)| near(reading.position_counts, 600)), Some(true));
    rig.pass(1_000);
    assert!(near(rig.counts(BASE), 600), "torque is off, and the old goal is lost");
}

#[test]
fn a_power_cycle_drops_unfinished_answers_and_questions() {
    let mut rig = Rig::ready();
    rig.send(|b| ping(b, 0));
    rig.plant.bytes(rig.now, &[0xFF, 0xFF, 0]);
    rig.plant.power_cycle(rig.now);
    assert_eq!(rig.plant.deadline(), None);
    rig.pass(200);
    rig.plant.bytes(rig.now, &[2, 1, 0xFC]);
    assert_eq!(rig.plant.deadline(), None);
}

#[test]
fn goals_take_their_running_time_or_speed() {
    for (time_ms, speed, takes_ms) in [(0, 100, 3_000), (2_000, 0, 2_000), (2_000, 100, 3_000), (0, 0, 171)] {
        let mut rig = Rig::ready();
        rig.torque(BASE, 1);
        rig.goal(BASE, BASE_START + 300, time_ms, speed);
        rig.pass(takes_ms - 2);
        let almost = rig.counts(BASE);
        assert!(almost < BASE_START + 300, "time {time_ms}, speed {speed}: too early");
        rig.pass(160);
        assert!(near(rig.counts(BASE), BASE_START + 300), "time {time_ms}, speed {speed}: too late");
    }
}

#[test]
fn a_sync_write_starts_all_joints_together() {
    let mut rig = Rig::ready();
    rig.all_torque(Torque::On);
    let start = Joint::ALL.map(|joint| rig.counts(joint));
    let goal = |id: u8| {
        let [high, low] = (start[usize::from(id)] - 200).to_be_bytes();
        (id, [high, low, 0, 0, 1, 44])
    };
    rig.send(|b| sync_write(b, register::GOAL_POSITION, (0..7).map(goal)));
    for _ in 0..9 {
        rig.pass(100);
        let gone = [0, 1, 2, 3, 4, 5, 6].map(|i| start[i] - rig.counts(Joint::ALL[i]));
        // The droop of a level joint is up to 4 counts, and changes on the way.
        assert!(gone.iter().all(|counts| counts.abs_diff(gone[0]) <= 4), "{gone:?}");
    }
    assert!(near(start[0] - rig.counts(BASE), 200), "300 counts/s");
}

#[test]
fn only_a_servo_with_torque_is_driven() {
    for codes in [TorqueCodes::DampingOnFree, TorqueCodes::FreeOnDamping] {
        let mut rig = Rig::with(ServoConfig { torque_codes: codes, ..ServoConfig::default() });
        rig.pass(200);
        for torque in [Torque::Damping, Torque::Free] {
            rig.torque(BASE, codes.code(torque));
            rig.goal(BASE, 700, 0, 0);
            rig.pass(1_000);
            assert_eq!(rig.counts(BASE), BASE_START, "{torque:?}");
            rig.plant.move_by_hand(BASE, 300);
            rig.pass(1_000);
            assert_eq!(rig.counts(BASE), 300, "{torque:?}: the hand holds it");
            rig.plant.move_by_hand(BASE, BASE_START);
        }
        rig.torque(BASE, codes.code(Torque::On));
        rig.pass(1_000);
        assert!(near(rig.counts(BASE), 700), "with torque, a servo moves to the goal from before");
        rig.plant.move_by_hand(BASE, 650);
        rig.pass(1_000);
        assert!(near(rig.counts(BASE), 700), "a servo with torque returns to its goal");
    }
}

#[test]
fn a_servo_with_torque_and_without_a_goal_moves_to_0() {
    // This exposes a controller that switches torque on before it sends a goal.
    let mut rig = Rig::ready();
    rig.torque(BASE, 1);
    rig.pass(2_000);
    assert!(near(rig.counts(BASE), 0));
}

#[test]
fn a_moving_arm_becomes_warm_and_lowers_the_supply_voltage() {
    let mut rig = Rig::ready();
    rig.all_torque(Torque::On);
    for round in 0..60 {
        let target = if round % 2 == 0 { 900_u16 } else { 100 };
        rig.all_goals([target; JOINTS]);
        rig.pass(100);
        let (reading, errors) = rig.reading(BASE).unwrap();
        rig.pass(400);
        assert!((60..74).contains(&reading.voltage_decivolts), "{} dV", reading.voltage_decivolts);
        assert_eq!(errors, 0);
    }
    let (warm, _) = rig.reading(BASE).unwrap();
    assert!((26..40).contains(&warm.temperature_celsius), "{} degrees", warm.temperature_celsius);
    (0..10).for_each(|_| rig.pass(100_000));
    let (rested, _) = rig.reading(BASE).unwrap();
    assert_eq!((rested.voltage_decivolts, rested.speed), (73, 0), "other joints carry weight");
    assert!(rested.load.abs() < 41, "static friction holds up to 100 of 2450 mN m: {}", rested.load);
    assert!(rested.temperature_celsius < warm.temperature_celsius);
}

#[test]
fn the_motion_does_not_depend_on_the_calls() {
    let run = |pause: u64| {
        let mut rig = Rig::ready();
        rig.torque(BASE, 1);
        rig.goal(BASE, 900, 0, 400);
        (0..600 / pause).for_each(|_| rig.pass(pause));
        rig.reading(BASE).unwrap()
    };
    assert_eq!(run(1), run(600));
    assert_eq!(run(7), run(595), "595 is a multiple of 7");
}

#[test]
fn a_plant_at_rest_is_the_same_as_one_that_is_simulated_step_by_step() {
    for fault in [None, Some("restarting=700"), Some("stuck"), Some("missing")] {
        let mut rigs = [Rig::driven(), Rig::driven()];
        for rig in &mut rigs {
            rig.plant.set_fault(Joint::ALL[2], fault.map(|fault| fault.parse().unwrap()));
        }
        for second in 0..120 {
            for (rig, steps) in rigs.iter_mut().zip([1, 1_000]) {
                if second % 40 == 5 {
                    rig.all_goals([300 + 2 * second, 445, 684, 511, 512, 512, 1_008]);
                }
                for _ in 0..steps {
                    // A call that may change a servo ends its rest.
                    rig.plant.support(false);
                    rig.pass(1_000 / steps);
                }
            }
            let [seldom, often] = &mut rigs;
            assert_eq!(seldom.pose(), often.pose(), "{fault:?} at {second} s");
            for joint in Joint::ALL {
                assert_eq!(seldom.reading(joint), often.reading(joint), "{joint:?} {fault:?} at {second} s");
            }
        }
    }
}
