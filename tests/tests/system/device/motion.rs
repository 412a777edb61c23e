//! Motion of the arm and reports of it: `docs/protocol.md`, D9 to D14, D17 and D18.
//!
//! A busy machine makes moves and reports slower, never faster, so the tests check the shortest time only. To show that
//! something is fast, a test repeats it until it was fast once.

use std::thread::sleep;
use std::time::{Duration, Instant};

use system_tests::registers::{
    BAUD_RATE, EFFECTOR_TYPE, FEEDBACK_FREQUENCY, MOTOR_STATE, MOVING_JOINTS, OFFSET, PRESENT_POSITION,
    SPEED, STANDARD_POSE, TARGET_POSITION, TIME,
};
use system_tests::{Need, TestArm, TestSetup, near, with_arm};

/// Moves joint 1 to an angle. The other joints move a little and back, so that all joints are known to have torque.
fn start_at(arm: &mut TestArm, degrees: u8) {
    arm.write(SPEED, &[100; 7]);
    let mut pose = arm.positions();
    pose[0] = degrees;
    let pose: [u8; 7] = pose.try_into().expect("seven joints");
    arm.drive_to(&pose.map(|at| if at > 40 { at - 4 } else { at + 4 }));
    arm.drive_to(&pose);
}

/// Writes, and returns the joints that move directly afterwards.
fn start_move(arm: &mut TestArm, address: u8, values: &[u8]) -> u8 {
    arm.write_and_read((address, values), (MOVING_JOINTS, 1))[0]
}

/// Moves joint 1 to an angle. Returns an upper bound of the time that its set-point took.
fn time_move(arm: &mut TestArm, degrees: u8) -> Duration {
    let start = Instant::now();
    let moving = start_move(arm, TARGET_POSITION, &[degrees]);
    assert_eq!(moving & 1, 1, "joint 1 moves directly after the write");
    arm.wait_until_still();
    let duration = start.elapsed();
    assert_eq!(arm.register(TARGET_POSITION), degrees);
    arm.wait_until("joint 1 is at its target", |arm| near(arm.register(PRESENT_POSITION), degrees));
    duration
}

fn assert_at_least(duration: Duration, planned: Duration) {
    // The clocks of the arm and of this machine may differ.
    assert!(duration >= planned.mul_f64(0.9), "{duration:?} instead of {planned:?}");
}

/// D9: the measured angle is the servo's angle plus the offset. The commanded angle is the target minus the offset.
#[test]
fn d09_an_offset_shifts_the_measured_angle() {
    with_arm(TestSetup::any(), |arm| {
        start_at(arm, 90);
        arm.write(MOTOR_STATE, &[2]);
        let expect_with = |arm: &mut TestArm, offset: u8, degrees: u8| {
            arm.write_setting(OFFSET, &[offset]);
            arm.wait_until("the offset has an effect", |arm| near(arm.register(PRESENT_POSITION), degrees));
        };
        expect_with(arm, 10, 100);
        expect_with(arm, 0x8A, 80);
        expect_with(arm, 0x80, 90);
        expect_with(arm, 10, 100);
        arm.write(MOTOR_STATE, &[1]);
        assert!(near(arm.register(TARGET_POSITION), 100), "the arm holds the measured angle");
        time_move(arm, 90);
        arm.write(MOTOR_STATE, &[2]);
        // The servo is at 80 degrees: with the offset it was measured at 90.
        expect_with(arm, 0, 80);
        arm.write(MOTOR_STATE, &[1]);
    });
}

/// D10: 1.9 degrees/s per unit.
#[test]
fn d10_the_speed_determines_the_time_of_a_move() {
    with_arm(TestSetup::any(), |arm| {
        start_at(arm, 90);
        arm.write(SPEED, &[10]);
        // 38 degrees take 2 s at 19 degrees/s.
        assert_at_least(time_move(arm, 128), Duration::from_secs(2));
        arm.write(SPEED, &[40]);
        assert_at_least(time_move(arm, 90), Duration::from_millis(500));
    });
}

/// D11: a change of the speed has an immediate effect on a move.
#[test]
fn d11_a_change_of_speed_has_an_effect_on_the_present_move() {
    with_arm(TestSetup::any(), |arm| {
        arm.wait_until("a slow move ends soon after the change", |arm| {
            start_at(arm, 90);
            arm.write(SPEED, &[1]);
            assert_eq!(start_move(arm, TARGET_POSITION, &[128]), 1);
            sleep(Duration::from_millis(300));
            let start = Instant::now();
            arm.write(SPEED, &[100]);
            arm.wait_until_still();
            arm.wait_until("joint 1 is at its target", |arm| near(arm.register(PRESENT_POSITION), 128));
            // At the old speed, almost 20 s would remain.
            start.elapsed() < Duration::from_secs(15)
        });
    });
}

/// D11: with speed 0 a move takes the time of the time register.
#[test]
fn d11_without_a_speed_the_time_register_applies() {
    with_arm(TestSetup::any(), |arm| {
        start_at(arm, 90);
        arm.write(SPEED, &[0]);
        arm.write(TIME, &[20]);
        assert_at_least(time_move(arm, 100), Duration::from_secs(2));
        assert_at_least(time_move(arm, 60), Duration::from_secs(2));
    });
}

/// D11: the speed has precedence over the time. If both are 0, a move has the maximum speed of the motor.
#[test]
fn d11_speed_has_precedence_over_time_and_the_motor_limits_both() {
    with_arm(TestSetup::any(), |arm| {
        start_at(arm, 90);
        arm.write(SPEED, &[100]);
        arm.write(TIME, &[100]);
        let mut target = 90;
        arm.wait_until("38 degrees at 190 degrees/s take less than 10 s", |arm| {
            target = if target == 90 { 128 } else { 90 };
            time_move(arm, target) < Duration::from_secs(9)
        });
        arm.write(TARGET_POSITION, &[128]);
        arm.wait_until_still();
        arm.write(SPEED, &[0]);
        for time in [0, 1] {
            arm.write(TIME, &[time]);
            // 74 degrees take 0.2 s at 372 degrees/s. A shorter time does not make the joint faster (D11).
            assert_at_least(time_move(arm, 54), Duration::from_millis(200));
            assert_at_least(time_move(arm, 128), Duration::from_millis(200));
        }
    });
}

/// D17: one frame starts all joints at once, each at its own speed.
#[test]
fn d17_all_joints_of_a_pose_start_together() {
    with_arm(TestSetup::any(), |arm| {
        start_at(arm, 90);
        let pose: Vec<u8> =
            arm.positions().iter().map(|&at| if at > 60 { at - 20 } else { at + 20 }).collect();
        arm.write(SPEED, &[10, 20, 30, 40, 50, 60, 70]);
        let start = Instant::now();
        assert_eq!(start_move(arm, TARGET_POSITION, &pose), 0x7F);
        arm.wait_until_still();
        // The slowest joint takes 1.05 s.
        assert_at_least(start.elapsed(), Duration::from_millis(1_050));
        arm.wait_for_pose(&pose);
    });
}

/// D12: after power-up the measured positions are the targets, and nothing moves.
#[test]
fn d12_the_arm_holds_its_position_after_power_up() {
    with_arm(TestSetup::any().needs(Need::FreshArm), |arm| {
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(1) {
            let values = arm.read(TARGET_POSITION, 15);
            assert_eq!(values[..7], STANDARD_POSE, "targets");
            let is_held =
                values[8..].iter().zip(STANDARD_POSE).all(|(&actual, expected)| near(actual, expected));
            assert!(is_held, "{values:?}: a loaded joint droops by less than a degree");
            assert_eq!(arm.register(MOVING_JOINTS), 0);
        }
    });
}

/// D12: the arm stays in another pose than the standard one.
#[test]
fn d12_after_a_power_cycle_the_arm_stays_where_it_was() {
    with_arm(TestSetup::any().needs(Need::PowerCycle), |arm| {
        start_at(arm, 130);
        arm.power_cycle(115_200);
        let mut pose = STANDARD_POSE;
        pose[0] = 130;
        arm.wait_for_pose(&pose);
        sleep(Duration::from_millis(500));
        arm.wait_for_pose(&pose);
        let targets = arm.read(TARGET_POSITION, 7);
        assert!(near(targets[0], 130), "{targets:?}");
        assert_eq!(arm.register(MOVING_JOINTS), 0);
    });
}

/// D12: the controller alone restarts, and no joint falls. Because of a silent servo the start takes half a second, enough
/// for a fall of 30 degrees.
#[test]
fn d12_after_a_restart_of_the_controller_the_arm_stays_where_it_was() {
    with_arm(TestSetup::any().needs(Need::PowerCycle).fault("7=missing"), |arm| {
        let mut pose = STANDARD_POSE;
        // Rear arm and forearm point to the front, and would fall without torque.
        (pose[0], pose[1], pose[2]) = (130, 45, 80);
        let pose = &pose[..6];
        arm.wait_for_pose(&STANDARD_POSE[..6]);
        arm.write(TARGET_POSITION, pose);
        arm.wait_for_pose(pose);
        for _ in 0..3 {
            arm.restart_controller();
            let is_pose =
                |found: &[u8]| found.iter().zip(pose).all(|(&actual, &wanted)| near(actual, wanted));
            // A joint has its target when it is held again. On a busy machine its servo answers late.
            arm.wait_until("each joint is held where it was", |arm| is_pose(&arm.read(TARGET_POSITION, 7)));
            sleep(Duration::from_millis(500));
            let positions = arm.positions();
            assert!(is_pose(&positions), "{positions:?}");
            assert_eq!(arm.register(MOVING_JOINTS), 0);
        }
    });
}

/// D13: in the states damping and forceless no joint is driven. On entry to the state servo the arm holds its position.
#[test]
fn d13_outside_servo_state_no_joint_is_driven_and_positions_are_measured() {
    with_arm(TestSetup::any().supported(), |arm| {
        for state in [0, 2] {
            start_at(arm, 90);
            let here = arm.positions();
            arm.write(MOTOR_STATE, &[state]);
            arm.write(TARGET_POSITION, &[120]);
            sleep(Duration::from_millis(500));
            let there = arm.positions();
            let stayed = here.iter().zip(&there).all(|(before, after)| near(*after, *before));
            assert!(stayed, "in state {state} the arm moved from {here:?} to {there:?}");
            arm.write(MOTOR_STATE, &[1]);
            let targets = arm.read(TARGET_POSITION, 7);
            let holds = targets.iter().zip(&there).all(|(target, at)| near(*target, *at));
            assert!(holds, "in servo state the targets are {targets:?} at {there:?}");
            assert_eq!(arm.register(MOVING_JOINTS), 0);
        }
    });
}

/// D13: the rest of the frame that enters servo state applies after the targets were set.
#[test]
fn d13_a_frame_that_enters_servo_state_may_contain_targets() {
    with_arm(TestSetup::any(), |arm| {
        start_at(arm, 90);
        arm.write(MOTOR_STATE, &[2]);
        let mut frame = arm.read(MOTOR_STATE, 24);
        frame[0] = 1;
        frame[usize::from(TARGET_POSITION - MOTOR_STATE)] = 120;
        let moving = start_move(arm, MOTOR_STATE, &frame);
        assert_eq!(moving & 1, 1, "joint 1 moves, although it has to be measured first");
        assert_eq!(arm.register(TARGET_POSITION), 120);
        arm.wait_until("joint 1 is at its target", |arm| near(arm.register(PRESENT_POSITION), 120));
    });
}

/// Receives `count` reports, and checks that their frequency does not exceed `hertz`.
fn receive_reports(arm: &mut TestArm, start: Instant, count: u32, hertz: u32) {
    for _ in 0..count {
        let report = arm.reply();
        assert_eq!((report.address, report.values.len()), (PRESENT_POSITION, 7));
    }
    assert_at_least(start.elapsed(), Duration::from_secs(1) * (count - 1) / hertz);
}

/// D14: the frequency of reports does not exceed the requested one, and 0 stops them.
#[test]
fn d14_reports_have_their_frequency_and_stop_at_zero() {
    with_arm(TestSetup::any(), |arm| {
        let here = arm.positions();
        let start = Instant::now();
        arm.write(FEEDBACK_FREQUENCY, &[20]);
        let report = arm.reply();
        assert_eq!((report.address, report.values.len()), (PRESENT_POSITION, here.len()));
        // A joint that droops may pass from one degree to the next meanwhile.
        assert!(
            report.values.iter().zip(&here).all(|(&shown, &read)| near(shown, read)),
            "{report:?} after {here:?}"
        );
        receive_reports(arm, start, 40, 20);
        arm.write(FEEDBACK_FREQUENCY, &[0]);
        arm.read(FEEDBACK_FREQUENCY, 1);
        assert_eq!(arm.reply_within(Duration::from_millis(500)), None);
        arm.expect_nothing_more();
    });
}

/// D14: replies between reports are complete and in order.
#[test]
fn d14_reads_have_replies_between_reports() {
    with_arm(TestSetup::any(), |arm| {
        arm.write(FEEDBACK_FREQUENCY, &[50]);
        for round in 0..100_u8 {
            arm.write(EFFECTOR_TYPE, &[round & 1]);
            assert_eq!(arm.register(EFFECTOR_TYPE), round & 1);
            sleep(Duration::from_millis(5));
        }
        receive_reports(arm, Instant::now(), 1, 50);
        arm.write(FEEDBACK_FREQUENCY, &[0]);
    });
}

/// D14: reports take at most half the line: 34 Hz at 9600 baud.
#[test]
fn d14_reports_take_at_most_half_of_a_slow_line() {
    with_arm(TestSetup::any().needs(Need::PowerCycle).needs(Need::Persistence), |arm| {
        arm.write_setting(BAUD_RATE, &[7]);
        arm.power_cycle(9_600);
        let start = Instant::now();
        arm.write(FEEDBACK_FREQUENCY, &[50]);
        // At 50 Hz, these 103 reports would take only 2 s.
        receive_reports(arm, start, 103, 34);
        // Half of the line is free for replies.
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 50, "the register keeps its value");
    });
}

/// D18: the registers hold whole degrees from 0 to 180, even if a joint is beyond.
#[test]
fn d18_positions_are_limited_to_0_and_180() {
    with_arm(TestSetup::any().needs(Need::FreshArm), |arm| {
        for (end, offset, beyond) in [(180, 10, 180), (0, 0x8A, 0)] {
            start_at(arm, end);
            arm.write(MOTOR_STATE, &[2]);
            arm.write_setting(OFFSET, &[offset]);
            arm.wait_until("the position is limited", |arm| arm.register(PRESENT_POSITION) == beyond);
            arm.write_setting(OFFSET, &[0]);
            arm.write(MOTOR_STATE, &[1]);
        }
    });
}
