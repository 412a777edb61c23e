//! A joint whose servo switched itself off: when it engages anew (D28).

use crate::rig::Rig;
use arm_sim::servo::Trip;
use motion_core::servo_bus::Torque;
use protocol_core::time::Instant;

use super::{ALARMS, LET_GO, bit, joint};

/// An arm that carries 100 g. The servo of joint 3 has tripped. Also returns the angle of joint 3 before that, in millidegrees.
fn tripped(trip: Trip) -> (Rig, i32) {
    let mut rig = Rig::started();
    rig.plant.set_load(100);
    rig.run_ms(1_000);
    let before = rig.plant.angle(joint(3));
    rig.forget();
    rig.plant.trip(joint(3), trip);
    (rig, before)
}

#[test]
fn d28_an_overload_lets_go_is_damped_and_engages_where_it_came_to_rest() {
    let (mut rig, before) = tripped(Trip::Overload);
    rig.run_ms(400);
    assert_eq!((rig.get(LET_GO), rig.get(242)), (bit(3), 0));
    rig.run_ms(2_000);
    assert_eq!((rig.get(LET_GO), rig.get(ALARMS)), (0, 0), "engaged anew");
    let held = rig.plant.angle(joint(3));
    assert!((held - before).abs() < 12_000, "{before} to {held}: it was damped on the way");
    rig.run_ms(3_000);
    assert!((rig.plant.angle(joint(3)) - held).abs() < 2_500, "and holds");
    assert_eq!(rig.targets()[2].abs_diff(rig.present()[2]) / 3, 0);
}

#[test]
fn d28_the_target_of_a_joint_that_is_let_go_follows_it() {
    let (mut rig, _) = tripped(Trip::Heat);
    let before = rig.present()[2];
    rig.run_ms(400);
    for _ in 0..20 {
        rig.run_ms(100);
        assert_eq!(rig.get(LET_GO), bit(3));
        let (target, present) = (rig.targets()[2], rig.present()[2]);
        assert!(target.abs_diff(present) <= 1, "the target is {target} at {present} degrees");
    }
    assert!(rig.present()[2].abs_diff(before) > 5, "it fell");
}

#[test]
fn d28_heat_has_to_fall_by_five_degrees() {
    let (mut rig, _) = tripped(Trip::Heat);
    rig.run_ms(3_000);
    assert_eq!((rig.get(LET_GO), rig.get(ALARMS)), (bit(3), 4));
    let mut cooled = 0;
    while rig.get(LET_GO) != 0 {
        rig.run_ms(1_000);
        cooled += 1;
        assert!(cooled < 600, "it never cools down");
    }
    assert!(rig.get(255) <= 80 && cooled > 5, "{cooled} s, {} degrees Celsius", rig.get(255));
}

#[test]
fn d28_a_joint_engages_anew_three_times_in_a_minute_and_then_only_by_order() {
    let mut rig = Rig::started();
    for attempt in 0..3 {
        rig.plant.restart_servo(Instant::from_micros(rig.now_us), joint(2));
        rig.run_ms(1_500);
        assert_eq!(rig.get(LET_GO), 0, "attempt {attempt}");
    }
    rig.plant.restart_servo(Instant::from_micros(rig.now_us), joint(2));
    rig.run_ms(1_500);
    assert_eq!(rig.get(LET_GO), bit(2));
    rig.run_ms(70_000);
    assert_eq!(rig.get(LET_GO), bit(2), "also after the minute");
    rig.write(29, &[1]);
    rig.run_ms(100);
    assert_eq!(rig.get(LET_GO), 0, "a 1 in state 1");
    assert_eq!(rig.plant.torque(joint(2)), Some(Torque::On));
}

#[test]
fn d28_without_protection_nothing_engages_by_itself() {
    let mut rig = Rig::started();
    rig.write(192, &[0]);
    rig.plant.restart_servo(Instant::from_micros(rig.now_us), joint(2));
    rig.run_ms(5_000);
    assert_eq!((rig.get(LET_GO), rig.plant.has_torque(joint(2))), (bit(2), false));
    rig.write(29, &[1]);
    rig.run_ms(100);
    assert_eq!((rig.get(LET_GO), rig.plant.has_torque(joint(2))), (0, true));
}

#[test]
fn d28_a_latched_overload_gets_torque_off_before_torque() {
    // Each write comes while the joint rests without torque: the joint may engage at the next answer.
    for (register, value) in [(192, 1), (29, 1)] {
        for delay_us in (0..5_000).step_by(250) {
            let mut rig = Rig::started();
            rig.write(192, &[0]);
            rig.plant.support(true);
            rig.plant.trip(joint(3), Trip::Overload);
            rig.write(48, &[80]);
            rig.run_ms(3_000);
            assert_eq!((rig.get(LET_GO), rig.get(ALARMS)), (bit(3), 32));
            rig.now_us += delay_us;
            rig.forget();
            rig.write(register, &[value]);
            rig.run_ms(1_000);
            assert_eq!((rig.get(LET_GO), rig.get(ALARMS)), (0, 0), "register {register}, {delay_us} us");
            let told: Vec<u8> = rig.torques().filter_map(|torques| torques[2]).collect();
            assert!(told.first().is_some_and(|code| *code != 1), "{told:?}");
        }
    }
}

#[test]
fn d28_a_servo_that_holds_again_by_itself_is_not_freed() {
    for (register, value) in [(192, 1), (29, 1)] {
        let mut rig = Rig::started();
        rig.write(192, &[0]);
        rig.plant.trip(joint(3), Trip::Heat);
        rig.run_ms(2_000);
        assert_eq!((rig.get(LET_GO), rig.get(ALARMS)), (bit(3), 4));
        while rig.get(ALARMS) != 0 {
            rig.run_ms(1_000);
        }
        rig.run_ms(2_000);
        let held = rig.plant.angle(joint(3));
        rig.forget();
        rig.write(register, &[value]);
        for _ in 0..300 {
            rig.run_ms(1_000);
            let moved = (rig.plant.angle(joint(3)) - held).abs();
            assert!(moved < 2_000, "register {register}: it sinks by {moved}");
        }
        assert!(rig.torques().all(|torques| matches!(torques[2], None | Some(1))), "no torque-off");
        assert_eq!((rig.get(LET_GO), rig.plant.torque(joint(3))), (0, Some(Torque::On)), "it engaged");
    }
}

#[test]
fn d28_a_target_is_taken_after_the_joint_engaged_and_a_point_of_a_stream_is_not() {
    for (period, goes_there) in [(0, true), (20, false)] {
        let (mut rig, _) = tripped(Trip::Overload);
        rig.run_ms(500);
        rig.write(184, &[period, 0]);
        rig.write(132, &5_000_u16.to_le_bytes());
        rig.run_ms(4_000);
        assert_eq!(rig.get(LET_GO), 0);
        let is_there = (rig.plant.angle(joint(3)) - 50_000).abs() < 3_000;
        assert_eq!(is_there, goes_there, "period {period}: {}", rig.plant.angle(joint(3)));
    }
}
