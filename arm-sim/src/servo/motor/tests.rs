use super::MotorMode::{Blocked, Driven, Free};
use super::*;
use crate::servo::surroundings::{Side, Surface};

/// A motor may arrive this much later than its set-point.
const SETTLING_MS: u32 = 250;
/// Static friction holds a joint within this distance of its set-point. An error of 20.3 counts gives the stall torque,
/// 2450 mN m, so the friction of 100 mN m holds an error of 0.83 counts.
const FRICTION_COUNTS: u16 = 1;

fn motor(joint: usize) -> Motor {
    Motor::new(Joint::ALL[joint - 1], 100)
}

fn steps(motor: &mut Motor, count: u32, mode: MotorMode) {
    (0..count).for_each(|_| motor.step(mode));
}

/// Drives the motor until it has arrived. Returns the number of steps.
fn duration_ms(motor: &mut Motor) -> u32 {
    for step in 0..100_000 {
        if !motor.is_moving() {
            return step;
        }
        motor.step(Driven);
    }
    panic!("the motor does not arrive");
}

fn goal(position_counts: u16, time_ms: u16, speed: u16) -> ServoGoal {
    ServoGoal { position_counts, time_ms, speed }
}

fn assert_takes(motor: &mut Motor, millis: u32) {
    let took = duration_ms(motor);
    assert!((millis..millis + SETTLING_MS).contains(&took), "{took} ms instead of {millis}");
}

fn assert_is_at(motor: &Motor, counts: u16) {
    let is = motor.position_counts();
    assert!(is.abs_diff(counts) <= FRICTION_COUNTS, "{is}, not {counts}");
}

#[test]
fn no_motor_turns_faster_than_62_rpm() {
    assert_eq!(motor(1).no_load_distance, 1_756_666, "850/180 counts a degree");
    assert_eq!(motor(7).no_load_distance, 1_291_666, "625/180");
    for (joint, counts_per_second) in [(1, 1_756), (7, 1_291)] {
        for goal in [goal(1_000, 0, 0), goal(1_000, 1, 0), goal(1_000, 0, 5_000)] {
            let mut motor = motor(joint);
            motor.start(goal);
            steps(&mut motor, 200, Driven);
            let lost = counts_per_second - motor.speed();
            assert!((0..=counts_per_second / 25).contains(&lost), "friction takes up to 4 %: {lost}");
            assert!(motor.torque() < 100, "a far set-point is no overload: {}", motor.torque());
            assert_takes(&mut motor, 900_000 / u32::from(counts_per_second.unsigned_abs()) - 200);
            assert_is_at(&motor, 1_000);
        }
    }
}

#[test]
fn a_load_takes_its_share_of_the_full_speed() {
    for (weight, percent) in
        [(0, 96..=97), (-1_225_000, 44..=46), (1_225_000, 100..=145), (-2_450_000, 0..=0)]
    {
        let mut motor = motor(3);
        motor.surroundings.weight = weight;
        motor.start(goal(1_000, 0, 0));
        steps(&mut motor, 250, Driven);
        let speed = i32::from(motor.speed()) * 100 / 1_756;
        assert!(percent.contains(&speed), "{weight}: {speed} %");
    }
}

#[test]
fn speed_is_in_counts_per_second_and_has_precedence_over_time() {
    let mut motor = motor(1);
    motor.start(goal(700, 100, 300));
    assert_takes(&mut motor, 2_000);
    assert_is_at(&motor, 700);
}

#[test]
fn time_is_used_if_speed_is_0() {
    let mut motor = motor(1);
    motor.start(goal(700, 3_000, 0));
    assert_takes(&mut motor, 3_000);
    assert_is_at(&motor, 700);
    motor.start(goal(50, 1_000, 0));
    assert_takes(&mut motor, 1_000);
    assert_is_at(&motor, 50);
}

#[test]
fn a_new_speed_takes_effect_during_the_move() {
    let mut motor = motor(1);
    motor.start(goal(700, 0, 300));
    steps(&mut motor, 1_000, Driven);
    motor.start(goal(700, 0, 100));
    assert_takes(&mut motor, 3_000);
}

#[test]
fn following_error_and_load_are_those_of_the_speed_and_the_friction() {
    let mut motor = motor(1);
    for (target, sign) in [(700, 1), (0, -1)] {
        motor.start(goal(target, 0, 300));
        steps(&mut motor, 1_000, Driven);
        // Duty for the speed: 300 of 1756 counts/s, 17.1 %. Duty for the friction: 80 mN m of the stall torque of 2450 mN m,
        // 3.3 %.
        assert!((300 - motor.speed() * sign).abs() <= 1, "{}", motor.speed());
        assert!((200..=207).contains(&(motor.load() * sign)), "{}", motor.load());
        assert!((29..=36).contains(&(motor.torque() * sign)), "{}", motor.torque());
        // 20.3 counts of error give full duty.
        let error = i64::from(motor.load()) * 20_306 - motor.error;
        assert!(error.abs() < COUNT / 20, "{error} millionths of a count");
        steps(&mut motor, 3_000, Driven);
    }
}

#[test]
fn a_step_settles_within_a_count_in_300_ms() {
    for joint in 1..=7 {
        for distance in [5, 20, 100, 200] {
            let mut motor = motor(joint);
            motor.start(goal(100 + distance, 0, 0));
            steps(&mut motor, 300, Driven);
            for _ in 0..1_000 {
                let is = motor.position_counts();
                assert!(is.abs_diff(100 + distance) <= 1, "joint {joint}: {is} after {distance}");
                motor.step(Driven);
            }
            assert!(motor.is_at_rest(Driven), "joint {joint}");
        }
    }
}

#[test]
fn a_released_motor_without_weight_stays() {
    let mut motor = motor(1);
    motor.start(goal(700, 0, 0));
    steps(&mut motor, 500, Free);
    assert_eq!((motor.position_counts(), motor.load(), motor.is_moving()), (100, 0, false));
    motor.turn_to(u16::MAX);
    motor.step(Free);
    assert_eq!((motor.position_counts(), motor.speed()), (1_023, 0));
}

#[test]
fn the_load_of_a_blocked_motor_is_proportional_to_its_error() {
    // 4.3 degrees are 20.3 counts of joints 1 to 4 and 14.9 counts of joints 5 to 7.
    for (joint, error, load) in [
        (1, 0_i16, 0),
        (1, 5, 246),
        (1, 10, 492),
        (1, 20, 984),
        (1, 21, 1_000),
        (1, 600, 1_000),
        (5, 10, 669),
    ] {
        for sign in [1, -1] {
            let mut motor = motor(joint);
            motor.turn_to(511);
            motor.step(Free);
            motor.start(goal((511 + sign * error).unsigned_abs(), 0, 0));
            steps(&mut motor, 1_000, Blocked);
            assert_eq!((motor.position_counts(), motor.speed()), (511, 0));
            assert_eq!([motor.load(), motor.torque()], [load * sign; 2], "joint {joint}, {error} counts");
        }
    }
}

#[test]
fn a_driven_motor_droops_by_its_load_less_the_friction() {
    for sign in [1, -1] {
        let mut motor = motor(3);
        motor.surroundings.weight = 1_000_000 * sign;
        motor.surroundings.inertia = 20_000_000;
        motor.start(goal(500, 0, 300));
        steps(&mut motor, 3_000, Driven);
        // An error of 20.3 counts gives the stall torque, 2450 mN m. So the weight, 1000 mN m, needs 8.29 counts. Friction, at
        // most 150 mN m, changes this by at most 1.24 counts.
        let droop = (motor.position - 500 * COUNT) * sign;
        assert!((7_050_000..9_530_000).contains(&droop), "{droop}");
        let load = -droop * sign * 1_000 / 20_305_555;
        assert!((i64::from(motor.load()) - load).abs() <= 1 && motor.load().abs() < 470, "{}", motor.load());
        assert!(motor.is_at_rest(Driven) && !motor.is_at_rest(Free));
        let before = motor.position;
        steps(&mut motor, 1_000, Driven);
        assert_eq!(motor.position, before);
    }
}

#[test]
fn a_released_motor_turns_under_its_weight_to_its_end() {
    for (weight, end) in [(400_000, 1_023), (-400_000, 0)] {
        let mut motor = motor(3);
        motor.surroundings.weight = weight;
        motor.step(Free);
        assert!(!motor.is_at_rest(Free));
        steps(&mut motor, 10_000, Free);
        assert_eq!((motor.position_counts(), motor.speed(), motor.load()), (end, 0, 0));
        assert!(motor.is_at_rest(Free));
    }
}

#[test]
fn torque_stops_a_fall() {
    let mut motor = motor(3);
    motor.surroundings.inertia = 8_700_000;
    motor.turn_to(500);
    motor.surroundings.weight = -400_000;
    steps(&mut motor, 200, Free);
    let caught_at = motor.position_counts();
    assert!((400..480).contains(&caught_at), "{caught_at}");
    steps(&mut motor, 500, Driven);
    // The joint was falling when it got torque. Its weight, 400 mN m of the stall torque of 2450 mN m, makes it droop by
    // 3.3 counts.
    assert!((1..=9).contains(&(caught_at - motor.position_counts())), "{}", motor.position_counts());
}

/// A motor at 500 counts with an obstacle at 520, in the way of more counts.
fn motor_at_a_wall(stiffness: Option<i64>) -> Motor {
    let mut motor = motor(1);
    motor.turn_to(500);
    motor.step(Free);
    motor.surroundings.wall = Some(Surface { side: Side::MoreCounts, position: 520 * COUNT, stiffness });
    motor
}

#[test]
fn a_stiff_wall_stops_a_motor_which_then_pushes() {
    let mut motor = motor_at_a_wall(None);
    motor.start(goal(515, 0, 300));
    steps(&mut motor, 500, Driven);
    assert_is_at(&motor, 515);
    assert!(motor.load().abs() < 50, "it is free before the wall");
    motor.start(goal(530, 0, 300));
    steps(&mut motor, 500, Driven);
    assert_eq!((motor.position, motor.speed()), (520 * COUNT, 0));
    assert_eq!((motor.load(), motor.torque()), (492, 492), "10 of 20.3 counts");
    assert!(motor.is_at_rest(Driven));
    motor.surroundings.wall = None;
    steps(&mut motor, 500, Driven);
    assert_is_at(&motor, 530);
    motor.surroundings.wall =
        Some(Surface { side: Side::MoreCounts, position: 520 * COUNT, stiffness: None });
    motor.start(goal(400, 0, 0));
    steps(&mut motor, 1_000, Driven);
    assert_is_at(&motor, 400);
}

#[test]
fn a_soft_wall_gives_way_by_the_push() {
    // 120 mN m per count, which is the stiffness of the servo: 2450 mN m in 20.3 counts.
    let mut motor = motor_at_a_wall(Some(120_657));
    motor.start(goal(540, 0, 300));
    steps(&mut motor, 2_000, Driven);
    let (depth, friction) = (motor.position - 520 * COUNT, COUNT);
    assert!((depth - 10 * COUNT).abs() <= friction, "{depth}");
    assert!(motor.is_at_rest(Driven));
}

#[test]
fn a_hand_pushes_a_motor_off_its_goal_and_a_free_one_away() {
    let mut motor = motor(1);
    motor.start(goal(500, 0, 300));
    motor.surroundings.push = 1_000_000;
    steps(&mut motor, 3_000, Driven);
    assert!((507..=510).contains(&motor.position_counts()), "{}", motor.position_counts());
    assert!(motor.load() < -340, "{}", motor.load());
    motor.surroundings.push = 0;
    steps(&mut motor, 500, Driven);
    assert_is_at(&motor, 500);
    motor.surroundings.push = -300_000;
    steps(&mut motor, 500, Free);
    assert!(motor.position_counts() < 480);
}
