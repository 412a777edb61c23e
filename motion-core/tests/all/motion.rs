//! What the arm does: power-up, moves, states, offsets, vacuum, servos that fail (D9 to D13, D18, D20).

use crate::rig::{Rig, STANDARD_POSE, ToServos};
use arm_sim::servo::ServoFault;
use motion_core::Vacuum;
use protocol_core::registers::Joint;

const SERVO: u8 = 1;
const FORCELESS: u8 = 2;

fn joint(number: u8) -> Joint {
    Joint::new(number).unwrap()
}

/// A torque frame with `code` for every joint but one.
fn all_but(number: u8, code: u8) -> [Option<u8>; 7] {
    std::array::from_fn(|index| (index + 1 != number.into()).then_some(code))
}

#[test]
fn d12_power_up_measures_then_holds_then_drives() {
    let mut rig = Rig::new();
    rig.hand(1, 300); // (300 - 86) * 180 / 850 = 45.3 degrees
    rig.run_ms(1_000);
    let told: Vec<_> = rig.to_servos.iter().map(|(_, told)| told.clone()).collect();
    let first_goal = told.iter().position(|told| matches!(told, ToServos::Goals(_))).unwrap();
    let asked = |id| told[..first_goal].iter().filter(|&told| *told == ToServos::Ask(id)).count();
    assert!((0..7).all(|id| asked(id) >= 2), "every joint was measured before the first goal");
    let first_on =
        told.iter().position(|told| matches!(told, ToServos::Torque(t) if t.contains(&Some(1)))).unwrap();
    assert!(first_goal < first_on, "no servo wakes up with an old goal");
    assert!(rig.goals().all(|(_, goals)| goals.iter().all(|&(id, counts)| id != 0 || counts == 300)));
    assert_eq!(rig.targets(), [45, 90, 65, 90, 90, 90, 80]);
    rig.assert_at([45, 90, 65, 90, 90, 90, 80], "it holds");
    assert_eq!(rig.read(240, 4), [1, 0, 0, 0]);
    assert_eq!(rig.counter(252), 0, "servos that start up are no errors");
}

#[test]
fn d12_a_joint_that_cannot_be_read_is_left_alone_until_it_answers() {
    let mut rig = Rig::new();
    rig.plant.set_fault(joint(3), Some(ServoFault::Missing));
    rig.run_ms(1_000);
    assert_eq!(rig.targets(), STANDARD_POSE);
    assert_eq!(rig.read(241, 2), [2, 0b100]);
    assert!(rig.goals().all(|(_, goals)| goals.iter().all(|&(id, _)| id != 2)));
    assert!(rig.torques().all(|torque| torque[2].is_none()), "nothing but questions");
    assert_eq!(rig.torques().last(), Some(all_but(3, 1)), "the others hold");
    rig.plant.set_fault(joint(3), None);
    rig.hand(3, 600); // a = (600 - 141) * 180 / 850 = 97.2, reversed: 82.8
    rig.run_ms(1_000);
    assert_eq!(rig.read(241, 2), [0, 0]);
    assert_eq!(rig.targets()[2], 83, "it holds where it was found");
    assert_eq!(rig.torques().last(), Some([Some(1); 7]));
}

#[test]
fn d12_a_target_written_during_start_up_is_not_forgotten() {
    let mut rig = Rig::new();
    rig.run_ms(5);
    rig.write(46, &[120]);
    rig.run_ms(3_000);
    assert_eq!(rig.present()[0], 120);
    assert_eq!(rig.targets()[0], 120);
}

#[test]
fn d10_d11_a_pose_at_the_default_speed() {
    let mut rig = Rig::started();
    rig.write(46, &[147, 90, 65, 90, 90, 90, 80]);
    assert_eq!(rig.get(243) & 1, 1, "joint 1 moves");
    let millis = rig.run_until_still();
    assert!((490..=510).contains(&millis), "57 degrees at 114 degrees/s, not {millis} ms");
    rig.run_ms(100);
    rig.assert_at([147, 90, 65, 90, 90, 90, 80], "it arrives");
}

#[test]
fn d11_all_joints_of_a_timed_pose_arrive_together() {
    let mut rig = Rig::started();
    rig.write(32, &[0; 7]);
    rig.write(39, &[20; 7]);
    rig.write(46, &[30, 120, 80, 45, 135, 10, 60]);
    let millis = rig.run_until_still();
    assert!((1_990..=2_010).contains(&millis), "{millis} ms");
    let moving: Vec<_> = rig.goals().collect();
    assert!(moving.iter().all(|(_, goals)| goals.len() == 7), "all in one frame");
}

#[test]
fn d11_speed_zero_and_time_zero_is_62_rpm_and_never_more() {
    let mut rig = Rig::started();
    rig.write(32, &[0]);
    rig.write(46, &[180]);
    rig.run_until_still();
    rig.write(46, &[0]);
    let millis = rig.run_until_still();
    assert!((480..=495).contains(&millis), "180 degrees at 372 degrees/s, not {millis} ms");
    let steps: Vec<u16> = rig.goals().map(|(_, goals)| goals[0].1).collect();
    // 3.72 degrees a cycle are 17.6 counts.
    assert!(steps.windows(2).all(|pair| pair[0].abs_diff(pair[1]) <= 18));
}

#[test]
fn goals_come_every_10_ms() {
    let mut rig = Rig::started();
    rig.run_ms(5_000);
    let times: Vec<u64> = rig.goals().map(|(at, _)| at).collect();
    assert!((499..=501).contains(&times.len()), "{}", times.len());
}

#[test]
fn a_late_shell_makes_motion_late_and_not_fast() {
    let mut rig = Rig::started();
    rig.write(46, &[180]);
    rig.run_ms(100);
    rig.now_us += 3_000_000;
    rig.run_ms(1_000);
    let goals: Vec<u16> = rig.goals().map(|(_, goals)| goals[0].1).collect();
    // 1.14 degrees a cycle are 5.4 counts.
    assert!(goals.windows(2).all(|pair| pair[0].abs_diff(pair[1]) <= 6), "{goals:?}");
    assert_eq!(rig.present()[0], 180);
}

#[test]
fn d13_forceless_lets_go_and_servo_holds_what_the_hand_showed() {
    let mut rig = Rig::started();
    rig.plant.support(true);
    rig.write(29, &[FORCELESS]);
    rig.run_ms(100);
    assert_eq!(rig.torques().last(), Some([Some(2); 7]));
    let forearm = rig.present()[2];
    rig.forget();
    rig.write(46, &[10; 7]);
    rig.hand(1, 511); // 90 degrees
    rig.hand(4, 300); // a = 45.3, reversed: 134.7
    rig.run_ms(500);
    assert_eq!(rig.goals().count(), 0, "nothing is commanded");
    assert_eq!(rig.get(243), 0);
    assert_eq!(rig.present(), [90, 90, forearm, 135, 90, 90, 80], "measured all the time");
    assert_eq!(rig.targets(), [10; 7], "a target may be written, and is forgotten");
    rig.write(29, &[SERVO]);
    assert_eq!(rig.targets(), [90, 90, forearm, 135, 90, 90, 80], "at once");
    rig.run_ms(500);
    assert!(rig.goals().all(|(_, goals)| goals.iter().all(|&(id, counts)| id != 3 || counts == 300)));
    assert_eq!(rig.torques().last(), Some([Some(1); 7]));
    rig.assert_at([90, 90, forearm, 135, 90, 90, 80], "it holds what the hand showed");
}

#[test]
fn d13_damping_brakes() {
    let mut rig = Rig::started();
    rig.write(46, &[170]);
    rig.run_ms(100);
    rig.write(29, &[0]);
    rig.forget();
    rig.run_ms(500);
    assert_eq!(rig.torques().last(), Some([Some(0); 7]));
    assert_eq!(rig.goals().count(), 0);
    assert_eq!(rig.get(243), 0, "a joint that is not driven is not on its way");
}

#[test]
fn d13_targets_in_the_frame_that_enters_servo_win_over_the_measured_ones() {
    let mut rig = Rig::started();
    rig.plant.support(true);
    rig.write(29, &[FORCELESS]);
    rig.run_ms(100);
    let mut values = vec![SERVO, 0, 0];
    values.extend([60; 7]); // speed
    values.extend([0; 7]); // time
    values.extend([120, 100]); // two targets
    rig.write(29, &values);
    // Joint 3 was measured at 66 degrees, because the forearm had drooped.
    assert_eq!(rig.targets(), [120, 100, 66, 90, 90, 90, 80]);
    rig.run_ms(2_000);
    rig.assert_at([120, 100, 66, 90, 90, 90, 80], "it arrives");
}

#[test]
fn d13_writing_the_state_that_is_there_changes_nothing() {
    let mut rig = Rig::started();
    rig.write(46, &[150]);
    rig.run_ms(100);
    rig.write(29, &[SERVO]);
    assert_eq!(rig.targets()[0], 150, "the move goes on");
    rig.run_ms(2_000);
    assert_eq!(rig.present()[0], 150);
}

#[test]
fn d09_an_offset_changes_what_is_seen_and_where_the_servo_goes() {
    let mut rig = Rig::started();
    let before = rig.plant.position_counts(joint(1));
    rig.write(28, &[0]);
    rig.forget();
    rig.write(13, &[0x85]); // -5 degrees
    rig.run_ms(20);
    let first = rig.goals().next().unwrap().1[0].1;
    assert!(first.abs_diff(before) <= 6, "no jump: {before} to {first}");
    rig.run_ms(1_000);
    assert_eq!(rig.present()[0], 90, "it went to where 90 is now");
    let after = rig.plant.position_counts(joint(1));
    assert!((23..=25).contains(&after.abs_diff(before)), "5 degrees are 23.6 counts: {before} to {after}");
    assert!(after > before, "servo angle = angle wanted - offset");
    rig.write(13, &[0x80]);
    rig.run_ms(1_000);
    assert_eq!(rig.get(13), 0x80);
    assert!(rig.plant.position_counts(joint(1)).abs_diff(before) <= 1, "minus zero is zero");
}

#[test]
fn d09_a_setting_written_during_a_timed_move_does_not_disturb_it() {
    let mut rig = Rig::started();
    rig.write(28, &[0]);
    rig.write(32, &[0]);
    rig.write(39, &[10]);
    rig.write(46, &[130]);
    rig.run_ms(500);
    rig.write(11, &[77, 0, 0x80]);
    let millis = rig.run_until_still();
    assert!((490..=510).contains(&millis), "{millis} ms left of one second");
}

#[test]
fn d18_present_positions_are_clamped_to_180() {
    let mut rig = Rig::started();
    rig.write(29, &[FORCELESS]);
    rig.hand(1, 1_000); // 193 degrees
    rig.hand(2, 1_000); // a = 207, reversed: -27
    rig.run_ms(200);
    assert_eq!(rig.present()[..2], [180, 0]);
}

#[test]
fn d20_the_pump_and_the_valve() {
    let mut rig = Rig::started();
    rig.write(31, &[1]);
    let on = rig.now_us;
    rig.run_ms(1_000);
    rig.write(31, &[0]);
    let off = rig.now_us;
    rig.run_ms(1_000);
    let suck = Vacuum { pump: true, valve: false };
    let release = Vacuum { pump: false, valve: true };
    assert_eq!(rig.vacuum, [(on, suck), (off, release), (off + 500_000, Vacuum::default())]);
}
