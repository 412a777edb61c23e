use super::MotorMode::Driven;
use super::*;

const FREE: MotorMode = MotorMode::Released(Drag::Free);
/// A motor may take longer than its set-point by this: a few time constants.
const SETTLING_MS: u32 = 160;

fn motor(joint: usize) -> Motor {
    Motor::new(Joint::ALL[joint - 1], 100)
}

fn steps(motor: &mut Motor, count: u32, mode: MotorMode) {
    (0..count).for_each(|_| motor.step(mode));
}

/// Steps until the motor has arrived.
fn duration_ms(motor: &mut Motor) -> u32 {
    for step in 0..100_000 {
        if !motor.is_moving() {
            return step;
        }
        motor.step(Driven);
    }
    panic!("the motor does not arrive");
}

fn goal(position_counts: u16, time_ms: u16, speed: u16) -> Goal {
    Goal { position_counts, time_ms, speed }
}

fn assert_takes(motor: &mut Motor, millis: u32) {
    let took = duration_ms(motor);
    assert!((millis..millis + SETTLING_MS).contains(&took), "{took} ms instead of {millis}");
}

#[test]
fn no_motor_turns_faster_than_62_rpm() {
    assert_eq!(
        [max_distance(Joint::ALL[0]), max_distance(Joint::ALL[1])],
        [1_756_666; 2],
        "850/180 counts a degree"
    );
    assert_eq!([max_distance(Joint::ALL[4]), max_distance(Joint::ALL[6])], [1_291_666; 2], "625/180");
    for (joint, counts_per_second) in [(1, 1_757), (7, 1_292)] {
        for goal in [goal(1_000, 0, 0), goal(1_000, 1, 0), goal(1_000, 0, 5_000)] {
            let mut motor = motor(joint);
            motor.start(goal);
            steps(&mut motor, 200, Driven);
            assert!(i32::from(motor.speed()) <= counts_per_second);
            assert!(motor.load() < 400, "otherwise a far set-point overloads it");
            assert_takes(&mut motor, 900_000 / counts_per_second.unsigned_abs() - 200);
            assert_eq!(motor.position_counts(), 1_000);
        }
    }
}

#[test]
fn speed_is_in_counts_per_second_and_has_precedence_over_time() {
    let mut motor = motor(1);
    motor.start(goal(700, 100, 300));
    assert_takes(&mut motor, 2_000);
    assert_eq!(motor.position_counts(), 700);
}

#[test]
fn time_is_used_if_speed_is_0() {
    let mut motor = motor(1);
    motor.start(goal(700, 3_000, 0));
    assert_takes(&mut motor, 3_000);
    assert_eq!(motor.position_counts(), 700);
    motor.start(goal(50, 1_000, 0));
    assert_takes(&mut motor, 1_000);
    assert_eq!(motor.position_counts(), 50);
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
fn the_position_lags_and_speed_and_load_are_measured() {
    let mut motor = motor(1);
    motor.start(goal(700, 0, 300));
    steps(&mut motor, 500, Driven);
    assert_eq!(motor.position_counts(), 100 + 150 - 6, "300 counts/s times 20 ms");
    assert!((298..=300).contains(&motor.speed()), "{}", motor.speed());
    assert!((55..=60).contains(&motor.load()), "{}", motor.load());
    motor.start(goal(0, 0, 300));
    steps(&mut motor, 500, Driven);
    assert!((-300..=-298).contains(&motor.speed()), "{}", motor.speed());
    assert!((-60..=-55).contains(&motor.load()), "{}", motor.load());
}

#[test]
fn a_released_motor_without_weight_stays_and_a_blocked_motor_has_full_load() {
    let mut motor = motor(1);
    motor.start(goal(700, 0, 0));
    steps(&mut motor, 500, MotorMode::Blocked);
    assert_eq!((motor.position_counts(), motor.speed(), motor.load()), (100, 0, 1_000));
    steps(&mut motor, 500, FREE);
    assert_eq!((motor.position_counts(), motor.load(), motor.is_moving()), (100, 0, false));
    motor.turn_to(u16::MAX);
    motor.step(FREE);
    assert_eq!((motor.position_counts(), motor.speed()), (1_023, 0));
}

#[test]
fn a_driven_motor_droops_by_half_a_count_at_half_its_stall_torque_and_measures_the_load() {
    for (weight, load) in [(809_000, -500), (-809_000, 500)] {
        let mut motor = motor(3);
        motor.start(goal(500, 0, 0));
        motor.set_weight(weight);
        steps(&mut motor, 1_000, Driven);
        assert_eq!(motor.position(), 500 * COUNT + weight.signum() * COUNT / 2);
        assert_eq!((motor.load(), motor.speed()), (load, 0));
        assert!(motor.is_at_rest(Driven) && !motor.is_at_rest(FREE));
    }
}

#[test]
fn a_released_motor_turns_under_its_weight_to_its_end() {
    for (weight, end) in [(400_000, 1_023), (-400_000, 0)] {
        let mut motor = motor(3);
        motor.set_weight(weight);
        motor.step(FREE);
        assert!(!motor.is_at_rest(FREE));
        steps(&mut motor, 10_000, FREE);
        assert_eq!((motor.position_counts(), motor.speed(), motor.load()), (end, 0, 0));
        assert!(motor.is_at_rest(FREE));
    }
}

#[test]
fn torque_stops_a_fall() {
    let mut motor = motor(3);
    motor.turn_to(500);
    motor.set_weight(-400_000);
    steps(&mut motor, 200, FREE);
    let caught_at = motor.position_counts();
    assert!((400..480).contains(&caught_at), "{caught_at}");
    steps(&mut motor, 500, Driven);
    assert!(motor.position_counts().abs_diff(caught_at) <= 1, "{}", motor.position_counts());
}
