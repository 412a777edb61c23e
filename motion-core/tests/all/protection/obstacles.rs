//! A joint at an obstacle: how hard it pushes, and how it goes on (D27).

use crate::rig::Rig;
use arm_sim::plant::Thing;
use arm_sim::servo::ServoFault;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use protocol_core::registers::Joint;

use super::{ALARMS, BLOCKED, LET_GO, bit, joint, stiff_wall, stream};

/// Turns a joint to an angle by hand, while the arm is forceless.
fn put(rig: &mut Rig, number: u8, degrees: u8) {
    rig.hand(number, counts_from_angle(joint(number), MicroDegrees::from_degrees(degrees), 0));
}

/// The largest average push of a joint over 100 ms in 0.1 %, while `millis` pass. The joint must not turn, because its
/// load counts as its push.
fn largest_average_load(rig: &mut Rig, joint: Joint, millis: usize) -> i32 {
    let mut loads = Vec::new();
    let mut largest = 0;
    for _ in 0..millis {
        rig.run_ms(1);
        loads.push(i32::from(rig.plant.load(joint)));
        if let Some(window) = loads.len().checked_sub(100).map(|start| &loads[start..]) {
            largest = largest.max(window.iter().sum::<i32>().abs() / 100);
        }
    }
    largest
}

#[test]
fn d27_a_joint_at_a_wall_gives_way_is_blocked_and_stays() {
    let mut bad = Vec::new();
    for number in 1..=6 {
        for (speed, payload) in [(10, 0), (60, 0), (0, 0), (60, 300), (0, 300)] {
            let joint = joint(number);
            let mut rig = Rig::started();
            rig.plant.set_load(payload);
            rig.run_ms(500);
            let from = rig.present()[usize::from(number) - 1];
            let (wall, target) = (i32::from(from) + 10, from + 40);
            rig.plant.set_wall(joint, stiff_wall(wall));
            rig.write(31 + number, &[speed]);
            rig.write(45 + number, &[target]);
            // Wait until the joint is at the wall and has pushed harder than its limit.
            let mut over = 0;
            for _ in 0..3_000 {
                rig.run_ms(1);
                if rig.plant.load(joint).abs() > 700 {
                    over += 1;
                }
                if over > 0 && (rig.plant.angle(joint) - wall * 1_000).abs() < 300 {
                    break;
                }
            }
            rig.run_ms(300);
            let lasting = largest_average_load(&mut rig, joint, 3_000);
            let blocked = rig.get(BLOCKED);
            let target_now = rig.targets()[usize::from(number) - 1];
            let moving = rig.get(243);
            let before = rig.plant.angle(joint);
            rig.plant.set_wall(joint, None);
            let mut swing = 0;
            for _ in 0..2_000 {
                rig.run_ms(1);
                swing = swing.max((rig.plant.angle(joint) - before).abs());
            }
            // The wall also carries the payload of joint 3, so the joint swings farther when the wall is gone.
            let most = if payload == 0 { 4_000 } else { 5_500 };
            let is_held = lasting <= 750 && swing <= most && target_now < target;
            if !is_held || blocked != bit(number) || moving != 0 || rig.get(ALARMS) != 0 {
                bad.push(format!(
                    "joint {number}, speed {speed}, {payload} g: push {lasting}, blocked {blocked:#b}, moving \
                     {moving:#b}, target {target_now}, swing {swing}"
                ));
            }
        }
    }
    assert!(bad.is_empty(), "{bad:#?}");
}

#[test]
fn d27_a_joint_gives_way_also_out_of_the_linkage() {
    let mut rig = Rig::started();
    rig.write(188, &[1]);
    rig.write(29, &[2]);
    rig.run_ms(100);
    for (number, degrees) in [(2, 20), (3, 40)] {
        let counts = counts_from_angle(joint(number), MicroDegrees::from_degrees(degrees), 0);
        rig.plant.move_by_hand(joint(number), counts);
    }
    rig.run_ms(500);
    rig.write(29, &[1]);
    rig.run_ms(500);
    // The arm is outside the linkage, so the set-point of joint 2 goes inwards. To give way to the obstacle, the set-point has
    // to come back outwards.
    rig.plant.set_wall(joint(2), stiff_wall(22));
    rig.write(47, &[90]);
    rig.run_ms(1_000);
    let load = largest_average_load(&mut rig, joint(2), 3_000);
    assert!(load <= 750, "{load}");
    assert_eq!((rig.get(BLOCKED), rig.get(ALARMS), rig.get(LET_GO)), (bit(2), 0, 0));
}

#[test]
fn d27_a_lift_at_full_load_keeps_its_limit_while_the_target_is_far_away() {
    for (speed, payload) in [(0, 475), (100, 475), (0, 500), (100, 500), (60, 500)] {
        let (mut rig, pitch) = (Rig::started(), joint(5));
        rig.write(193, &[75]);
        rig.write(36, &[speed]);
        rig.write(29, &[2]);
        rig.run_ms(500);
        put(&mut rig, 3, 125);
        put(&mut rig, 5, 180);
        rig.plant.set_load(payload);
        rig.run_ms(300);
        rig.write(29, &[1]);
        rig.run_ms(100);
        [3, 5].into_iter().for_each(|number| rig.plant.let_go(joint(number)));
        // The joint turns, but so slowly that its push is over the limit. Its servo is at full load.
        rig.write(50, &[0]);
        let (mut over, mut longest) = (0, 0);
        for _ in 0..4_000 {
            rig.run_ms(1);
            over = if rig.plant.motor_torque(pitch).abs() > 800 { over + 1 } else { 0 };
            longest = longest.max(over);
        }
        assert!((1..=300).contains(&longest), "over the limit for {longest} ms, speed {speed}, {payload} g");
        assert_eq!((rig.get(ALARMS), rig.get(LET_GO)), (0, 0));
    }
}

#[test]
fn d27_a_stream_goes_on_as_far_as_the_limit_allows_and_is_taken_up_again() {
    let (mut rig, joint) = (Rig::started(), joint(1));
    rig.write(184, &[20, 0]);
    rig.plant.set_wall(joint, stiff_wall(100));
    stream(&mut rig, 1, (0..150).map(|step| 9_000 + step * 20));
    rig.plant.set_wall(joint, stiff_wall(100));
    stream(&mut rig, 1, (0..100).map(|_| 12_000));
    assert_eq!(rig.get(BLOCKED), bit(1), "held back for more than a second");
    assert!(largest_average_load(&mut rig, joint, 1) == 0 && rig.plant.load(joint).abs() <= 750);
    stream(&mut rig, 1, (0..10).map(|_| 12_000));
    assert_eq!(rig.get(BLOCKED), bit(1), "a point does not clear it");
    rig.plant.set_wall(joint, None);
    let before = rig.plant.angle(joint);
    stream(&mut rig, 1, (0..5).map(|_| 12_000));
    let speed = (rig.plant.angle(joint) - before) / 100;
    assert!(speed <= 180, "at its speed of 114 degrees/s and the spring: {speed}");
    stream(&mut rig, 1, (0..30).map(|_| 12_000));
    assert_eq!((rig.get(BLOCKED), rig.present()[0]), (0, 120));
}

#[test]
fn d27_the_next_target_clears_the_bit_and_tries_again() {
    let (mut rig, joint) = (Rig::started(), joint(1));
    rig.plant.set_wall(joint, stiff_wall(100));
    rig.write(46, &[130]);
    rig.run_ms(2_500);
    assert_eq!((rig.get(BLOCKED), rig.get(243)), (bit(1), 0));
    rig.write(46, &[131]);
    assert_eq!((rig.get(BLOCKED), rig.get(243)), (0, bit(1)));
    let load = largest_average_load(&mut rig, joint, 2_000);
    assert!(load <= 750, "it does not push again harder for 300 ms: {load}");
    assert_eq!(rig.get(BLOCKED), bit(1));
    rig.write(46, &[80]);
    rig.run_ms(1_000);
    assert_eq!((rig.get(BLOCKED), rig.present()[0]), (0, 80));
}

#[test]
fn d27_a_joint_that_carries_more_than_its_limit_sinks_slowly() {
    let mut rig = Rig::started();
    let joint = joint(3);
    // The forearm is level and carries 250 g. The limit is below its load by 2 to 3 % of the stall torque, so the limit + 5 %
    // (D27) carries it.
    rig.plant.set_load(250);
    rig.run_ms(1_000);
    let carried = rig.plant.load(joint).abs();
    let limit = u8::try_from(carried / 10 - 2).unwrap();
    rig.write(193, &[limit]);
    let mut fastest = 0;
    let mut before = rig.plant.angle(joint);
    for _ in 0..50 {
        rig.run_ms(100);
        let angle = rig.plant.angle(joint);
        fastest = fastest.max((angle - before).abs() * 10);
        before = angle;
    }
    assert!((500..=10_500).contains(&fastest), "{fastest} millidegrees/s at {carried} over {limit} %");
    assert_eq!(rig.get(BLOCKED) & bit(3), bit(3));
}

#[test]
fn d27_a_hand_pushes_a_joint_away_and_it_stays_there() {
    let (mut rig, joint) = (Rig::started(), joint(1));
    rig.plant.push(joint, 2_200);
    rig.run_ms(3_000);
    assert!(rig.plant.angle(joint) > 92_000, "it gives way");
    assert_eq!((rig.get(BLOCKED), rig.get(ALARMS), rig.get(LET_GO)), (bit(1), 0, 0));
    rig.plant.push(joint, 0);
    rig.run_ms(1_000);
    let rest = rig.plant.angle(joint);
    rig.run_ms(3_000);
    assert_eq!(rig.plant.angle(joint), rest, "it holds where it was pushed");
}

#[test]
fn d27_a_gripper_holds_a_thing_at_its_grip_limit_for_an_hour() {
    let (hour, minute) = (3_600_000, 60_000);
    for (limit, stiffness, millis) in
        [(10, Some(100), hour), (40, None, hour), (10, None, minute), (100, None, minute)]
    {
        let (mut rig, claw) = (Rig::started(), joint(7));
        rig.write(30, &[1]);
        rig.write(194, &[limit]);
        rig.plant.set_thing(Some(Thing { millidegrees: 60_000, stiffness }));
        rig.write(52, &[20]);
        rig.run_ms(2_000);
        let most = 10 * i32::from(limit) + 50;
        let load = largest_average_load(&mut rig, claw, 10_000);
        assert!(load <= most && (load > 0), "{load} at {limit} %, {stiffness:?}");
        rig.run_ms(millis);
        let load = largest_average_load(&mut rig, claw, 1_000);
        assert!(load <= most && load > 0, "{load} at {limit} % after {millis} ms, {stiffness:?}");
        if limit < 80 {
            assert_eq!((rig.get(ALARMS), rig.get(LET_GO)), (0, 0));
        }
    }
}

#[test]
fn d27_with_protection_off_the_servo_protects_itself() {
    let (mut rig, joint) = (Rig::started(), joint(1));
    rig.write(192, &[0]);
    rig.plant.set_wall(joint, stiff_wall(100));
    rig.write(46, &[130]);
    rig.run_ms(4_000);
    assert_eq!((rig.get(BLOCKED), rig.get(ALARMS), rig.get(LET_GO)), (0, 32, bit(1)));
    rig.run_ms(70_000);
    assert_eq!(rig.get(LET_GO), bit(1));
    rig.write(29, &[1]);
    rig.run_ms(1_000);
    assert_eq!((rig.get(ALARMS), rig.get(LET_GO)), (0, 0), "the order ends the latched overload, too");
}

#[test]
fn d27_a_stream_that_ended_at_an_obstacle_does_not_go_on_when_it_leaves() {
    let (mut rig, joint) = (Rig::started(), joint(1));
    rig.write(184, &[20, 0]);
    rig.plant.set_wall(joint, stiff_wall(100));
    stream(&mut rig, 1, (0..150).map(|_| 12_000));
    rig.run_ms(1_100);
    assert_eq!((rig.get(BLOCKED), rig.get(243)), (bit(1), 0));
    rig.plant.set_wall(joint, None);
    rig.run_ms(2_000);
    assert!(rig.plant.angle(joint) < 104_000, "{}", rig.plant.angle(joint));
    stream(&mut rig, 1, (0..50).map(|_| 12_000));
    assert_eq!((rig.get(BLOCKED), rig.present()[0]), (0, 120), "the next point goes on");
}

#[test]
fn d27_a_blocked_joint_whose_servo_was_silent_stays_blocked_until_the_next_target() {
    let (mut rig, joint) = (Rig::started(), joint(1));
    rig.plant.set_wall(joint, stiff_wall(100));
    rig.write(46, &[130]);
    rig.run_ms(2_500);
    assert_eq!(rig.get(BLOCKED), bit(1));
    rig.plant.set_fault(joint, Some(ServoFault::Garbled(1)));
    rig.run_ms(300);
    assert_eq!((rig.get(BLOCKED), rig.get(242)), (bit(1), bit(1)), "silent");
    rig.plant.set_fault(joint, None);
    rig.run_ms(1_000);
    assert_eq!((rig.get(BLOCKED), rig.get(242), rig.get(LET_GO)), (bit(1), 0, 0));
    rig.write(28, &[0]);
    rig.write(13, &[1]);
    rig.run_ms(100);
    assert_eq!(rig.get(BLOCKED), bit(1), "another offset is no target");
    rig.write(46, &[80]);
    rig.run_ms(1_000);
    assert_eq!(rig.get(BLOCKED), 0);
}
