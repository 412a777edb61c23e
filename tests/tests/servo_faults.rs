//! Servos that fail: the status block says so, and the other joints go on. `docs/protocol.md`, D12 and
//! section 4.

use std::thread::sleep;
use std::time::Duration;

use system_tests::registers::{
    FAULTS, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION, SERVO_BUS_ERRORS, STANDARD_POSE,
    TARGET_POSITION,
};
use system_tests::{Bench, Setup, near, with_arm};

/// The fault bit of the servo bus.
const SERVO_BUS: u8 = 1 << 1;
/// Joint 3, whose servo is the faulty one everywhere here: its place in poses, and its bit.
const FAULTY: usize = 2;
const FAULTY_BIT: u8 = 1 << FAULTY;

fn wait_for_missing(arm: &mut Bench, joints: u8) {
    arm.wait_until("the status block names the missing servos", |arm| arm.register(MISSING_SERVOS) == joints);
}

/// Sends all joints somewhere, and waits until all but the faulty one are there.
fn others_go_on(arm: &mut Bench) {
    for shift in [15, 0] {
        let pose = STANDARD_POSE.map(|degrees| degrees - shift);
        arm.write(TARGET_POSITION, &pose);
        arm.wait_until("the healthy joints are there", |arm| {
            let pairs = arm.positions().into_iter().zip(pose).enumerate();
            pairs.into_iter().all(|(joint, (is, wanted))| joint == FAULTY || near(is, wanted))
        });
    }
}

/// A servo that never answers; its joint is not driven, and its target is the standard pose's (D12).
#[test]
fn d12_a_missing_servo_is_named_and_the_others_go_on() {
    with_arm(Setup::any().fault("3=missing"), |arm| {
        wait_for_missing(arm, FAULTY_BIT);
        assert_eq!(arm.register(FAULTS) & SERVO_BUS, SERVO_BUS);
        assert_eq!(arm.register(TARGET_POSITION + 2), STANDARD_POSE[FAULTY]);
        others_go_on(arm);
        let errors = arm.counter(SERVO_BUS_ERRORS);
        arm.wait_until("each time it is asked counts", |arm| arm.counter(SERVO_BUS_ERRORS) != errors);
        assert_eq!(arm.register(MISSING_SERVOS), FAULTY_BIT);
    });
}

/// A servo whose answers are damaged is as good as missing, and its damage is never taken for a position.
#[test]
fn a_garbled_servo_is_named_and_its_damage_never_becomes_a_position() {
    with_arm(Setup::any().fault("3=garbled"), |arm| {
        wait_for_missing(arm, FAULTY_BIT);
        assert_eq!(arm.register(FAULTS) & SERVO_BUS, SERVO_BUS);
        let before = arm.register(PRESENT_POSITION + 2);
        let errors = arm.counter(SERVO_BUS_ERRORS);
        others_go_on(arm);
        assert_ne!(arm.counter(SERVO_BUS_ERRORS), errors);
        assert_eq!(arm.register(PRESENT_POSITION + 2), before);
    });
}

/// Now and then a damaged answer: it is counted, and the joint goes on all the same.
#[test]
fn a_servo_that_is_garbled_now_and_then_goes_on() {
    with_arm(Setup::any().fault("3=garbled=10"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        let errors = arm.counter(SERVO_BUS_ERRORS);
        others_go_on(arm);
        arm.wait_for_pose(&STANDARD_POSE);
        assert_ne!(arm.counter(SERVO_BUS_ERRORS), errors);
        assert_eq!(arm.register(MISSING_SERVOS), 0);
    });
}

/// Answers that come far too late are dropped, not taken for those of the servo asked next. (The emulated arm waits
/// for 50 ms, the one behind a USB adapter for 300 ms.)
#[test]
fn a_late_servo_is_named_and_confuses_no_other() {
    with_arm(Setup::any().fault("3=late=600"), |arm| {
        wait_for_missing(arm, FAULTY_BIT);
        others_go_on(arm);
        for _ in 0..50 {
            let positions = arm.positions();
            let wild = positions.iter().zip(STANDARD_POSE).enumerate();
            let wild = wild.filter(|&(joint, (is, wanted))| joint != FAULTY && !near(*is, wanted));
            assert_eq!(wild.count(), 0, "{positions:?}");
        }
        assert_eq!(arm.register(MISSING_SERVOS), FAULTY_BIT);
    });
}

/// A joint that cannot turn shows where it really is, and its servo's complaint as a fault of the bus.
#[test]
fn a_stuck_joint_shows_where_it_is_and_raises_the_fault() {
    with_arm(Setup::any().fault("3=stuck"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        others_go_on(arm);
        arm.write(TARGET_POSITION + 2, &[STANDARD_POSE[FAULTY] - 30]);
        arm.wait_until("the overload shows", |arm| arm.register(FAULTS) & SERVO_BUS != 0);
        arm.wait_until("set-points have arrived", |arm| arm.register(MOVING_JOINTS) == 0);
        assert!(near(arm.register(PRESENT_POSITION + 2), STANDARD_POSE[FAULTY]));
        assert_eq!(arm.register(MISSING_SERVOS), 0, "it answers");
    });
}

/// A servo's overload lasts until its torque was off: so the status block shows whether letting go (D13) really
/// reaches the servos.
#[test]
fn d13_an_overloaded_servo_is_well_again_after_its_torque_was_off() {
    with_arm(Setup::any().fault("3=stuck"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        arm.write(TARGET_POSITION + 2, &[STANDARD_POSE[FAULTY] - 30]);
        arm.wait_until("the overload shows", |arm| arm.register(FAULTS) & SERVO_BUS != 0);
        for state in [0, 2] {
            arm.write(MOTOR_STATE, &[state]);
            arm.wait_until("the overload is gone", |arm| arm.register(FAULTS) & SERVO_BUS == 0);
            arm.write(MOTOR_STATE, &[1]);
            arm.write(TARGET_POSITION + 2, &[STANDARD_POSE[FAULTY] - 30]);
            arm.wait_until("the overload is back", |arm| arm.register(FAULTS) & SERVO_BUS != 0);
        }
    });
}

/// The controller hears its own requests on the one wire, and is not confused.
#[test]
fn an_echo_on_the_wire_changes_nothing() {
    with_arm(Setup::any().fault("bus=echo"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        others_go_on(arm);
        arm.wait_for_pose(&STANDARD_POSE);
        assert_eq!(arm.register(FAULTS) & SERVO_BUS, 0);
        assert_eq!(arm.register(MISSING_SERVOS), 0);
    });
}

/// Several servos at once, and no servo at all: the host is answered as ever.
#[test]
fn an_arm_without_servos_answers_its_host() {
    let mut setup = Setup::any();
    for joint in 1..=7 {
        setup = setup.fault(&format!("{joint}=missing"));
    }
    with_arm(setup, |arm| {
        wait_for_missing(arm, 0x7F);
        arm.write(TARGET_POSITION, &[10; 7]);
        sleep(Duration::from_millis(100));
        assert_eq!(arm.read(TARGET_POSITION, 7), [10; 7]);
        assert_eq!(arm.register(FAULTS) & SERVO_BUS, SERVO_BUS);
    });
}
