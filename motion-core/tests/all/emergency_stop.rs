//! Servos that come back after a long silence, one by one or not at all (D29).

use crate::rig::{Rig, ToServos};
use arm_sim::servo::ServoFault;
use protocol_core::registers::Joint;
use protocol_core::time::Instant;

const FIRST: Joint = Joint::ALL[0];
const SUPPLY_LOST: u8 = 198;
const LET_GO: u8 = 196;

/// An arm whose servos have all been silent for three seconds: they receive every frame and hold, but all their answers are
/// damaged.
fn silent_arm() -> Rig {
    let mut rig = Rig::started();
    for joint in Joint::ALL {
        rig.plant.set_fault(joint, Some(ServoFault::Garbled(1)));
    }
    rig.run_ms(3_000);
    rig.forget();
    rig
}

/// A servo comes back, restarted or with the torque that it had.
fn comes_back(rig: &mut Rig, joint: Joint, has_restarted: bool) {
    if has_restarted {
        rig.plant.restart_servo(Instant::from_micros(rig.now_us), joint);
    }
    rig.plant.set_fault(joint, None);
}

fn was_only_asked(rig: &Rig) -> bool {
    rig.to_servos.iter().all(|(_, told)| matches!(told, ToServos::Ask(_)))
}

fn torque(rig: &Rig) -> [bool; 7] {
    Joint::ALL.map(|joint| rig.plant.has_torque(joint))
}

#[test]
fn d29_silent_joints_are_not_damped_when_one_servo_comes_back_restarted() {
    let mut rig = silent_arm();
    let held = Joint::ALL.map(|joint| rig.plant.angle(joint));
    comes_back(&mut rig, FIRST, true);
    rig.run_ms(5_000);
    assert!(was_only_asked(&rig), "a silent servo may still hold its joint");
    assert_eq!((rig.get(29), rig.get(SUPPLY_LOST), rig.get(LET_GO), rig.get(242)), (1, 0, 1, 0x7E));
    let holds = [false, true, true, true, true, true, true];
    assert_eq!(torque(&rig), holds);
    for joint in Joint::ALL {
        assert!((rig.plant.angle(joint) - held[usize::from(joint.index())]).abs() < 1_000, "{joint:?}");
    }
    Joint::ALL.into_iter().skip(1).for_each(|joint| comes_back(&mut rig, joint, false));
    rig.run_ms(1_000);
    assert_eq!((rig.get(29), rig.get(SUPPLY_LOST), rig.get(LET_GO), rig.get(242)), (1, 0, 0, 0));
    assert_eq!(torque(&rig), [true; 7], "a cable was gone");
}

#[test]
fn d29_one_servo_with_torque_tells_that_the_supply_was_there() {
    let mut rig = silent_arm();
    comes_back(&mut rig, FIRST, true);
    rig.run_ms(500);
    assert!(!rig.plant.has_torque(FIRST));
    comes_back(&mut rig, Joint::ALL[1], false);
    rig.run_ms(500);
    assert!(rig.plant.has_torque(FIRST), "engaged where it was measured");
    assert_eq!((rig.get(29), rig.get(SUPPLY_LOST), rig.get(LET_GO), rig.get(242)), (1, 0, 0, 0x7C));
}

#[test]
fn d29_servos_that_come_back_one_after_the_other_had_no_supply() {
    let mut rig = silent_arm();
    for joint in Joint::ALL {
        assert!(was_only_asked(&rig), "{joint:?}");
        assert_eq!((rig.get(29), rig.get(SUPPLY_LOST)), (1, 0), "{joint:?}");
        rig.plant.support(true);
        comes_back(&mut rig, joint, true);
        rig.run_ms(285);
    }
    rig.run_ms(300);
    assert_eq!((rig.get(29), rig.get(SUPPLY_LOST)), (0, 1));
    assert_eq!((rig.goals().count(), torque(&rig)), (0, [false; 7]));
}

#[test]
fn d29_a_write_of_the_motor_state_drives_the_servos_that_are_back() {
    let mut rig = silent_arm();
    comes_back(&mut rig, FIRST, true);
    rig.run_ms(2_000);
    rig.write(29, &[1]);
    rig.run_ms(200);
    assert!(rig.plant.has_torque(FIRST));
    assert_eq!((rig.get(LET_GO), rig.get(242)), (0, 0x7E));
    comes_back(&mut rig, Joint::ALL[1], true);
    rig.run_ms(500);
    assert_eq!((rig.get(29), torque(&rig)[1]), (1, true), "the host has ordered it");
}

#[test]
fn d29_a_joint_that_was_let_go_before_the_stop_does_not_engage_after_it() {
    let mut rig = Rig::started();
    rig.write(192, &[0]);
    rig.plant.restart_servo(Instant::from_micros(rig.now_us), FIRST);
    rig.run_ms(500);
    assert_eq!(rig.get(LET_GO), 1);
    for joint in Joint::ALL {
        rig.plant.set_fault(joint, Some(ServoFault::Garbled(1)));
    }
    rig.run_ms(3_000);
    rig.write(192, &[1]);
    comes_back(&mut rig, FIRST, true);
    rig.run_ms(1_000);
    assert!(!rig.plant.has_torque(FIRST), "the other servos have not answered");
    Joint::ALL.into_iter().skip(1).for_each(|joint| comes_back(&mut rig, joint, true));
    rig.run_ms(1_000);
    assert_eq!((rig.get(29), rig.get(SUPPLY_LOST)), (0, 1));
}

#[test]
fn d29_a_write_of_the_motor_state_drives_a_servo_that_was_not_driven_before_the_others_fell_silent() {
    let mut rig = Rig::started();
    rig.write(192, &[0]);
    rig.plant.restart_servo(Instant::from_micros(rig.now_us), FIRST);
    rig.run_ms(500);
    for joint in Joint::ALL.into_iter().skip(1) {
        rig.plant.set_fault(joint, Some(ServoFault::Garbled(1)));
    }
    rig.run_ms(3_000);
    assert_eq!((rig.get(LET_GO), rig.get(242)), (1, 0x7E));
    rig.write(29, &[1]);
    rig.run_ms(200);
    assert!(rig.plant.has_torque(FIRST), "it has supply");
    assert_eq!((rig.get(LET_GO), rig.get(242)), (0, 0x7E));
}

#[test]
fn d29_the_torque_of_a_joint_that_is_let_go_is_read_after_a_silence_too() {
    let joint = Joint::ALL[4];
    let mut rig = Rig::started();
    // Without protection nothing engages by itself.
    rig.write(192, &[0]);
    for _ in 0..2 {
        rig.plant.set_fault(joint, Some(ServoFault::Missing));
        rig.run_ms(300);
        rig.plant.set_fault(joint, None);
        rig.run_ms(500);
        assert_eq!(rig.get(LET_GO), 1 << joint.index());
    }
    rig.forget();
    rig.write(29, &[1]);
    rig.run_ms(100);
    let is_named = |goals: &[(u8, u16)]| goals.iter().any(|(id, _)| *id == joint.index());
    let goal_at = rig.goals().find(|(_, goals)| is_named(goals)).expect("it engages").0;
    let was_read = rig.torque_questions.iter().any(|(at, id)| *id == joint.index() && *at < goal_at);
    assert!(was_read, "a goal without a question about torque");
    assert!(rig.plant.has_torque(joint));
}

#[test]
fn d29_a_servo_that_answers_without_torque_has_supply_however_long_the_others_are_silent() {
    // The servo takes 200 ms to start, and is asked ten times a second. At some of these times it has answered, but does not
    // hold yet.
    for millis in 235..270 {
        let mut rig = Rig::started();
        for joint in Joint::ALL.into_iter().skip(1) {
            rig.plant.set_fault(joint, Some(ServoFault::Garbled(1)));
        }
        rig.run_ms(500);
        comes_back(&mut rig, FIRST, true);
        rig.run_ms(millis);
        rig.now_us += 1_500_000;
        rig.run_ms(500);
        assert!(rig.plant.has_torque(FIRST), "after {millis} ms");
        assert_eq!((rig.get(29), rig.get(SUPPLY_LOST), rig.get(LET_GO)), (1, 0, 0));
    }
}
