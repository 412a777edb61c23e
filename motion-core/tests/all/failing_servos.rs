//! Servos that are missing, stuck or badly connected, the echo of the bus, voltage and temperature, and the refresh of torque.

use crate::rig::{Rig, ToServos};
use arm_sim::servo::ServoFault;
use protocol_core::registers::Joint;
use protocol_core::time::Duration;

fn joint(number: u8) -> Joint {
    Joint::new(number).unwrap()
}

/// A torque frame with `code` for every joint but one.
fn all_but(number: u8, code: u8) -> [Option<u8>; 7] {
    std::array::from_fn(|index| (index + 1 != number.into()).then_some(code))
}

#[test]
fn a_servo_that_falls_silent_is_flagged_and_the_others_go_on() {
    let late = |millis| ServoFault::Late(Duration::from_millis(millis));
    for fault in
        [ServoFault::Missing, late(9), late(10), late(12), late(30), late(100), ServoFault::Garbled(1)]
    {
        let mut rig = Rig::started();
        rig.plant.set_fault(joint(5), Some(fault));
        rig.run_ms(200);
        assert_eq!(rig.read(241, 2), [2, 0b1_0000], "{fault:?}");
        assert!(rig.counter(252) >= 3, "{fault:?}");
        rig.forget();
        rig.run_ms(500);
        assert!(rig.torques().all(|torque| torque == all_but(5, 1)), "nothing but questions");
        rig.write(46, &[120, 80, 70, 100, 30, 100, 70]);
        rig.run_ms(2_000);
        let last = rig.present()[4];
        rig.assert_at([120, 80, 70, 100, last, 100, 70], fault);
        assert_eq!(rig.get(243), 0, "a joint that is not driven is not on its way");
    }
}

#[test]
fn each_servo_is_asked_once_in_a_cycle_and_a_missing_one_ten_times_a_second() {
    let mut rig = Rig::started();
    rig.plant.set_fault(joint(4), Some(ServoFault::Missing));
    rig.run_ms(200);
    rig.forget();
    rig.run_ms(1_000);
    for id in 0..7 {
        let asked = rig.to_servos.iter().filter(|(_, told)| *told == ToServos::Ask(id));
        let mut cycles: Vec<_> = asked.map(|(at_us, _)| at_us / 10_000).collect();
        assert_eq!(cycles.len(), if id == 3 { 10 } else { 100 }, "servo {id}");
        cycles.dedup();
        assert_eq!(cycles.len(), if id == 3 { 10 } else { 100 }, "servo {id}, not twice in a cycle");
    }
}

#[test]
fn a_joint_that_comes_back_while_a_hand_turns_it_gets_torque_only_at_rest() {
    let mut rig = Rig::started();
    rig.plant.set_fault(joint(3), Some(ServoFault::Missing));
    rig.run_ms(200);
    rig.plant.set_fault(joint(3), None);
    rig.forget();
    for step in 0..30 {
        rig.hand(3, 300 + 10 * step);
        rig.run_ms(10);
    }
    assert_eq!(rig.get(242), 0, "it is measured");
    assert_eq!(rig.get(56), 85, "(590 - 141) * 180 / 850 = 95.1, reversed: 84.9");
    assert!(rig.goals().all(|(_, goals)| goals.iter().all(|&(id, _)| id != 2)), "and not driven");
    rig.run_ms(100);
    assert!(rig.goals().flat_map(|(_, goals)| goals).all(|&(id, counts)| id != 2 || counts == 590));
    assert_eq!(rig.torques().last(), Some([Some(1); 7]));
}

#[test]
fn an_answer_garbled_now_and_then_costs_an_error_and_not_the_joint() {
    let mut rig = Rig::started();
    rig.plant.set_fault(joint(5), Some(ServoFault::Garbled(4)));
    rig.write(46, &[90, 90, 65, 90, 120]);
    rig.run_ms(2_000);
    assert_eq!(rig.get(242), 0);
    assert!(rig.counter(252) > 10);
    assert_eq!(rig.present()[4], 120);
}

#[test]
fn a_stuck_servo_is_told_by_its_position_and_counts_as_blocked() {
    let mut rig = Rig::started();
    rig.plant.set_fault(joint(2), Some(ServoFault::Stuck));
    rig.write(46, &[90, 120]);
    rig.run_ms(10_000);
    assert_eq!(rig.present()[1], 90);
    assert_eq!(rig.read(241, 3), [0, 0, 0], "no overload, and the move has ended");
    assert_eq!(rig.read(195, 3), [0b10, 0, 0]);
}

#[test]
fn its_own_echo_does_not_confuse_the_controller() {
    let mut rig = Rig::new();
    rig.plant.set_echo(true);
    rig.run_ms(1_000);
    rig.write(46, &[120]);
    rig.run_ms(2_000);
    assert_eq!(rig.present()[0], 120);
    assert_eq!(rig.counter(252), 0);
}

#[test]
fn voltage_and_temperature_are_shown_and_forgotten_with_the_servos() {
    let mut rig = Rig::started();
    let shown = rig.read(254, 2);
    assert!((60..=90).contains(&shown[0]) && (15..=60).contains(&shown[1]), "{shown:?}");
    Joint::ALL.into_iter().for_each(|joint| rig.plant.set_fault(joint, Some(ServoFault::Missing)));
    rig.run_ms(500);
    assert_eq!(rig.read(242, 1), [0x7F]);
    assert_eq!(rig.read(254, 2), [0, 0]);
}

#[test]
fn torque_is_set_again_now_and_then_in_case_a_frame_was_lost() {
    let mut rig = Rig::started();
    rig.run_ms(2_000);
    let count = rig.torques().count();
    assert!((7..=9).contains(&count), "{count} times in two seconds");
}
