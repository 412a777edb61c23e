//! Faults of servos: the status block reports them, and the other joints continue. `docs/protocol.md`, D12, D13, D27 and
//! section 6.

use std::thread::sleep;
use std::time::Duration;

use system_tests::registers::{
    BLOCKED_JOINTS, FAULTS, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION, PROTECTION,
    SERVO_BUS_ERRORS, STANDARD_POSE, TARGET_POSITION,
};
use system_tests::{TestArm, TestSetup, near, with_arm};

/// The fault bit of the servo bus.
const SERVO_BUS: u8 = 1 << 1;
/// The index and the bit of joint 3, which has the faulty servo in the tests of a single fault.
const FAULTY: usize = 2;
const FAULTY_BIT: u8 = 1 << FAULTY;

fn wait_for_missing(arm: &mut TestArm, joints: u8) {
    arm.wait_until("the missing servos are reported", |arm| arm.register(MISSING_SERVOS) == joints);
}

/// Moves all joints, and waits until all but the faulty one are at their targets.
fn move_others(arm: &mut TestArm) {
    for shift in [15, 0] {
        let pose = STANDARD_POSE.map(|degrees| degrees - shift);
        arm.write(TARGET_POSITION, &pose);
        arm.wait_until("the other joints are at their targets", |arm| {
            let pairs = arm.positions().into_iter().zip(pose).enumerate();
            pairs.into_iter().all(|(joint, (actual, expected))| joint == FAULTY || near(actual, expected))
        });
    }
}

/// A servo that never replies: its joint is not driven, and its target is the default (D12).
#[test]
fn d12_a_missing_servo_is_reported_and_the_others_continue() {
    with_arm(TestSetup::any().fault("3=missing"), |arm| {
        wait_for_missing(arm, FAULTY_BIT);
        assert_eq!(arm.register(FAULTS) & SERVO_BUS, SERVO_BUS);
        assert_eq!(arm.register(TARGET_POSITION + 2), STANDARD_POSE[FAULTY]);
        move_others(arm);
        let errors = arm.counter(SERVO_BUS_ERRORS);
        arm.wait_until("reads without a reply are counted", |arm| arm.counter(SERVO_BUS_ERRORS) != errors);
        assert_eq!(arm.register(MISSING_SERVOS), FAULTY_BIT);
    });
}

/// A servo whose replies are all corrupted counts as missing, and its replies do not change the measured position.
#[test]
fn a_garbled_servo_is_reported_and_its_position_does_not_change() {
    with_arm(TestSetup::any().fault("3=garbled"), |arm| {
        wait_for_missing(arm, FAULTY_BIT);
        assert_eq!(arm.register(FAULTS) & SERVO_BUS, SERVO_BUS);
        let before = arm.register(PRESENT_POSITION + 2);
        let errors = arm.counter(SERVO_BUS_ERRORS);
        move_others(arm);
        arm.wait_until("corrupted replies are counted", |arm| arm.counter(SERVO_BUS_ERRORS) != errors);
        assert_eq!(arm.register(PRESENT_POSITION + 2), before);
    });
}

/// Some corrupted replies: they are counted, and the joint continues.
#[test]
fn a_servo_with_some_corrupted_replies_continues() {
    with_arm(TestSetup::any().fault("3=garbled=10"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        let errors = arm.counter(SERVO_BUS_ERRORS);
        move_others(arm);
        arm.wait_until("corrupted replies are counted", |arm| arm.counter(SERVO_BUS_ERRORS) != errors);
        arm.wait_for_pose(&STANDARD_POSE);
        assert_eq!(arm.register(MISSING_SERVOS), 0);
    });
}

/// Late replies are dropped, and not assigned to the next servo. The servo timeout is 50 ms in the emulator, and 300 ms with
/// a USB adapter.
#[test]
fn a_late_servo_is_reported_and_has_no_effect_on_others() {
    with_arm(TestSetup::any().fault("3=late=600"), |arm| {
        wait_for_missing(arm, FAULTY_BIT);
        move_others(arm);
        for _ in 0..50 {
            let positions = arm.positions();
            let mut joints = positions.iter().zip(STANDARD_POSE).enumerate();
            let is_held =
                joints.all(|(joint, (&actual, expected))| joint == FAULTY || near(actual, expected));
            assert!(is_held, "{positions:?}");
        }
        assert_eq!(arm.register(MISSING_SERVOS), FAULTY_BIT);
    });
}

/// The position of a stuck joint is right, and the joint counts as blocked before its servo switches itself off (D27).
#[test]
fn d27_a_stuck_joint_reports_its_position_and_is_blocked() {
    with_arm(TestSetup::any().fault("3=stuck"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        move_others(arm);
        arm.write(TARGET_POSITION + 2, &[STANDARD_POSE[FAULTY] - 30]);
        arm.wait_until("the joint is blocked", |arm| arm.register(BLOCKED_JOINTS) == FAULTY_BIT);
        arm.wait_until("set-points have arrived", |arm| arm.register(MOVING_JOINTS) == 0);
        assert!(near(arm.register(PRESENT_POSITION + 2), STANDARD_POSE[FAULTY]));
        assert_eq!(arm.register(FAULTS) & SERVO_BUS, 0, "no alarm");
        assert_eq!(arm.register(MISSING_SERVOS), 0, "its servo replies");
    });
}

/// Without protection a servo switches itself off. Its overload alarm lasts until its torque is off, so the end of the alarm
/// shows that the motor states reach the servos (D13).
#[test]
fn d13_an_overload_alarm_ends_when_the_torque_is_off() {
    with_arm(TestSetup::any().fault("3=stuck"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        arm.write(PROTECTION, &[0]);
        arm.write(TARGET_POSITION + 2, &[STANDARD_POSE[FAULTY] - 30]);
        arm.wait_until("the overload is reported", |arm| arm.register(FAULTS) & SERVO_BUS != 0);
        for state in [0, 2] {
            arm.write(MOTOR_STATE, &[state]);
            arm.wait_until("the overload is gone", |arm| arm.register(FAULTS) & SERVO_BUS == 0);
            arm.write(MOTOR_STATE, &[1]);
            arm.write(TARGET_POSITION + 2, &[STANDARD_POSE[FAULTY] - 30]);
            arm.wait_until("the overload is back", |arm| arm.register(FAULTS) & SERVO_BUS != 0);
        }
    });
}

/// The controller receives its own frames on the single wire, and ignores them.
#[test]
fn an_echo_on_the_wire_changes_nothing() {
    with_arm(TestSetup::any().fault("bus=echo"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        move_others(arm);
        arm.wait_for_pose(&STANDARD_POSE);
        assert_eq!(arm.register(FAULTS) & SERVO_BUS, 0);
        assert_eq!(arm.register(MISSING_SERVOS), 0);
    });
}

/// Without servos, the arm replies to its host.
#[test]
fn an_arm_without_servos_replies_to_its_host() {
    let mut setup = TestSetup::any();
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
