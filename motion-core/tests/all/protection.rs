//! The protection of the arm: obstacles, servos that let go, and a lost supply (D27 to D29).

use crate::rig::{Rig, ToServos};
use arm_sim::plant::{Thing, Wall};
use arm_sim::servo::Trip;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use motion_core::servo_bus::Torque;
use protocol_core::registers::Joint;
use protocol_core::time::Instant;

const BLOCKED: u8 = 195;
const LET_GO: u8 = 196;
const ALARMS: u8 = 197;
const SUPPLY_LOST: u8 = 198;

fn joint(number: u8) -> Joint {
    Joint::new(number).expect("1 to 7")
}

fn stiff_wall(degrees: i32) -> Option<Wall> {
    Some(Wall { millidegrees: degrees * 1_000, stiffness: None })
}

fn bit(number: u8) -> u8 {
    1 << (number - 1)
}

/// The largest average push of a joint over 100 ms in 0.1 %, while `millis` pass. The joint does not turn.
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

/// Small reproducible numbers.
struct Numbers(u64);

impl Numbers {
    fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        let index = self.below(u64::try_from(values.len()).expect("few values"));
        values[usize::try_from(index).expect("few values")]
    }

    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }
}

/// A legal pose of joints 1 to 7.
fn pose(numbers: &mut Numbers) -> [u8; 7] {
    let two = 20 + numbers.below(140);
    let three = (84_u64.saturating_sub(two)).max(10) + numbers.below(120);
    let three = three.min(226 - two).min(170);
    let mut any = |from: u64, to: u64| u8::try_from(from + numbers.below(to - from)).expect("a byte");
    let [one, four, five, six] = [any(0, 180), any(0, 180), any(10, 170), any(0, 180)];
    [one, u8::try_from(two).unwrap(), u8::try_from(three).unwrap(), four, five, six, any(0, 84)]
}

/// Every frame for the servos during some moves with a payload.
fn frames_of_moves(seed: u64, protection: u8) -> (Vec<(u64, ToServos)>, u8) {
    let mut numbers = Numbers(seed);
    let mut rig = Rig::started();
    // A gripper or a suction cup.
    let has_gripper = numbers.below(2) == 0;
    rig.write(30, &[u8::from(has_gripper)]);
    rig.write(192, &[protection, 70, if numbers.below(2) == 0 { 20 } else { 40 }]);
    rig.plant.set_load(numbers.one_of(&[0, 100, 200, 300]));
    rig.run_ms(500);
    let mut blocked = 0;
    for _ in 0..4 {
        let speed = numbers.one_of(&[0, 0, 10, 60, 100]);
        rig.write(32, &[speed; 7]);
        let to = pose(&mut numbers);
        if numbers.below(2) == 0 {
            rig.write(184, &[0, 0]);
            rig.write(46, &to);
            rig.run_ms(100 + numbers.below(2_000));
        } else {
            rig.write(184, &[20, 0]);
            for step in 1..=numbers.below(100) {
                let words = to.map(|degrees| (u64::from(degrees) * 100 + step).to_le_bytes());
                let bytes: Vec<u8> = words.iter().flat_map(|word| [word[0], word[1]]).collect();
                rig.write(128, &bytes);
                rig.run_ms(20);
            }
        }
        blocked |= rig.get(BLOCKED) | rig.get(LET_GO);
    }
    (rig.to_servos, blocked)
}

#[test]
fn d27_free_motion_with_300_g_is_byte_for_byte_that_without_protection() {
    let seeds: u64 = std::env::var("FREE_MOTIONS").ok().and_then(|count| count.parse().ok()).unwrap_or(40);
    let mut bad = Vec::new();
    for seed in 0..seeds {
        let ((with, blocked), (without, _)) = (frames_of_moves(seed, 1), frames_of_moves(seed, 0));
        if with != without || blocked != 0 {
            let at = with.iter().zip(&without).position(|(a, b)| a != b);
            let first = at.map(|at| (&with[at], &without[at]));
            bad.push(format!("seed {seed}: {first:?}, flags {blocked:#b}"));
        }
    }
    assert!(bad.is_empty(), "{} of {seeds}: {bad:#?}", bad.len());
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
            // The push is over its limit since it arrived at the wall.
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
            // A payload pulls joint 3 the same way as its spring.
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
    // From outside, the set-point goes inwards: to the obstacle it has to come back outwards.
    rig.plant.set_wall(joint(2), stiff_wall(22));
    rig.write(47, &[90]);
    rig.run_ms(1_000);
    let load = largest_average_load(&mut rig, joint(2), 3_000);
    assert!(load <= 750, "{load}");
    assert_eq!((rig.get(BLOCKED), rig.get(ALARMS), rig.get(LET_GO)), (bit(2), 0, 0));
}

/// Puts a joint somewhere by hand, while the arm is forceless.
fn put(rig: &mut Rig, number: u8, degrees: u8) {
    rig.hand(number, counts_from_angle(joint(number), MicroDegrees::from_degrees(degrees), 0));
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
        // The joint turns, but so slowly that its push is over the limit. Its servo gives all it has.
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

/// Runs a stream of points of a joint, one each 20 ms, in hundredths of a degree.
fn stream(rig: &mut Rig, number: u8, points: impl Iterator<Item = u16>) {
    for point in points {
        rig.write(126 + 2 * number, &point.to_le_bytes());
        rig.run_ms(20);
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
    // Level, with 400 g: 65 % and friction. A limit of 60 % and 5 % more carry it.
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

/// Joint 3 with 100 g, whose servo trips.
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
    // Both orders come while the joint rests without torque: it may engage at the next answer.
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

#[test]
fn d29_an_emergency_stop_is_not_an_order_to_move() {
    for (millis, is_lost) in [(300, false), (3_000, true), (30_000, true)] {
        let mut rig = Rig::started();
        rig.write(184, &[20, 0]);
        stream(&mut rig, 1, (0..50).map(|step| 9_000 + step * 20));
        rig.plant.power_off(Instant::from_micros(rig.now_us));
        stream(&mut rig, 1, (0..millis / 20).map(|step| 10_000 + (step % 100) * 30));
        let angles = |rig: &Rig| Joint::ALL.map(|joint| rig.plant.angle(joint));
        let before = angles(&rig);
        rig.plant.power_cycle(Instant::from_micros(rig.now_us));
        // Nobody holds the arm; the servos start after 200 ms.
        Joint::ALL.into_iter().for_each(|joint| rig.plant.let_go(joint));
        rig.forget();
        let mut largest = 0;
        for step in 0..100 {
            stream(&mut rig, 1, std::iter::once(11_000 + step * 10));
            largest = largest.max((rig.plant.angle(joint(1)) - before[0]).abs());
        }
        assert_eq!(
            (rig.get(SUPPLY_LOST), rig.get(29)),
            (u8::from(is_lost), u8::from(!is_lost)),
            "{millis} ms"
        );
        if is_lost {
            assert!(largest < 1_000, "joint 1 moved by {largest} after {millis} ms");
            assert_eq!(rig.goals().count(), 0, "no goal");
            rig.write(29, &[1]);
            rig.run_ms(200);
            assert_eq!((rig.get(SUPPLY_LOST), rig.get(29)), (0, 1));
            assert!(rig.plant.has_torque(joint(1)));
        } else {
            assert!(
                rig.plant.has_torque(joint(1)) && rig.plant.has_torque(joint(3)),
                "engaged where measured"
            );
        }
    }
}

#[test]
fn d29_a_servo_that_restarted_engages_where_it_is_also_near_its_set_point() {
    let mut rig = Rig::started();
    rig.forget();
    rig.plant.restart_servo(Instant::from_micros(rig.now_us), joint(2));
    let restarted_at = rig.now_us;
    rig.run_ms(1_000);
    assert_eq!((rig.get(LET_GO), rig.plant.torque(joint(2))), (0, Some(Torque::On)));
    // From its first answer, torque follows a goal; before that there are questions only.
    let to_servo = |told: &ToServos| match told {
        ToServos::Goals(goals) => goals.iter().any(|&(id, _)| id == 1),
        ToServos::Torque(codes) => codes[1].is_some(),
        ToServos::Ask(_) => false,
    };
    let first = rig.to_servos.iter().find(|(at, told)| *at > restarted_at + 20_000 && to_servo(told));
    assert!(matches!(first, Some((at, ToServos::Goals(_))) if at - restarted_at > 200_000), "{first:?}");
}

#[test]
fn d29_an_adapter_that_was_gone_is_no_lost_supply() {
    let mut rig = Rig::started();
    for joint in Joint::ALL {
        rig.plant.set_fault(joint, Some(arm_sim::servo::ServoFault::Garbled(1)));
    }
    rig.run_ms(3_000);
    assert_eq!(rig.get(242), 0x7F);
    Joint::ALL.into_iter().for_each(|joint| rig.plant.set_fault(joint, None));
    rig.run_ms(1_000);
    assert_eq!((rig.get(242), rig.get(29), rig.get(SUPPLY_LOST), rig.get(LET_GO)), (0, 1, 0, 0));
    rig.write(46, &[100]);
    rig.run_ms(1_000);
    assert_eq!(rig.present()[0], 100);
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
