//! How the arm moves: `docs/protocol.md`, D9 to D14 and D18.
//!
//! A busy machine makes moves and reports look slower, never faster: so only the least time that they may take is
//! checked. Where it has to be shown that something is fast, one fast try proves it, however many it takes.

use std::thread::sleep;
use std::time::{Duration, Instant};

use system_tests::registers::{
    BAUD_RATE, EFFECTOR_TYPE, FEEDBACK_FREQUENCY, MOTOR_STATE, MOVING_JOINTS, OFFSET, PRESENT_POSITION,
    SPEED, STANDARD_POSE, TARGET_POSITION, TIME,
};
use system_tests::{Bench, Need, Setup, near, with_arm};

/// Puts joint 1 at an angle and lets it come to rest there. The others stay, after they have moved a little:
/// so all of them are known to be driven, which takes a moment after power-up.
fn start_at(arm: &mut Bench, degrees: u8) {
    arm.write(SPEED, &[100; 7]);
    let mut pose = arm.positions();
    pose[0] = degrees;
    let pose: [u8; 7] = pose.try_into().expect("seven joints");
    arm.drive_to(&pose.map(|at| if at > 40 { at - 4 } else { at + 4 }));
    arm.drive_to(&pose);
}

/// Writes, and says which joints are on their way directly after it.
fn set_off(arm: &mut Bench, address: u8, values: &[u8]) -> u8 {
    arm.write_and_read((address, values), (MOVING_JOINTS, 1))[0]
}

/// Sends joint 1 to an angle and says how long its set-point was on its way, at most.
fn time_move(arm: &mut Bench, degrees: u8) -> Duration {
    let start = Instant::now();
    let moving = set_off(arm, TARGET_POSITION, &[degrees]);
    assert_eq!(moving & 1, 1, "joint 1 is on its way as soon as it was told to");
    arm.wait_until_still();
    let duration = start.elapsed();
    assert_eq!(arm.register(TARGET_POSITION), degrees);
    arm.wait_until("joint 1 has followed", |arm| near(arm.register(PRESENT_POSITION), degrees));
    duration
}

fn assert_took(duration: Duration, planned: Duration) {
    // The clocks of the arm and of this machine need not agree to the last percent.
    assert!(duration >= planned.mul_f64(0.9), "{duration:?} instead of {planned:?}: too fast");
}

/// D9: the angle seen is the servo's plus the offset; the angle commanded is the one wanted less the offset.
#[test]
fn d09_an_offset_shifts_what_is_seen() {
    with_arm(Setup::any(), |arm| {
        start_at(arm, 90);
        arm.write(MOTOR_STATE, &[2]);
        let seen_with = |arm: &mut Bench, offset: u8, degrees: u8| {
            arm.write_setting(OFFSET, &[offset]);
            arm.wait_until("the offset shows", |arm| near(arm.register(PRESENT_POSITION), degrees));
        };
        seen_with(arm, 10, 100);
        seen_with(arm, 0x8A, 80);
        seen_with(arm, 0x80, 90);
        seen_with(arm, 10, 100);
        arm.write(MOTOR_STATE, &[1]);
        assert!(near(arm.register(TARGET_POSITION), 100), "the arm holds what it sees");
        time_move(arm, 90);
        arm.write(MOTOR_STATE, &[2]);
        // The servo stands at 80 now, where it was driven to be seen at 90.
        seen_with(arm, 0, 80);
        arm.write(MOTOR_STATE, &[1]);
    });
}

/// D10: 1.9 degrees/s per unit.
#[test]
fn d10_a_move_takes_as_long_as_its_speed_says() {
    with_arm(Setup::any(), |arm| {
        start_at(arm, 90);
        arm.write(SPEED, &[10]);
        // 38 degrees at 19 degrees/s.
        assert_took(time_move(arm, 128), Duration::from_secs(2));
        arm.write(SPEED, &[40]);
        assert_took(time_move(arm, 90), Duration::from_millis(500));
    });
}

/// D11: a change of the speed acts at once, in the middle of a move.
#[test]
fn d11_a_change_of_speed_acts_on_the_running_move() {
    with_arm(Setup::any(), |arm| {
        arm.wait_until("a slow move ends soon once it is fast", |arm| {
            start_at(arm, 90);
            arm.write(SPEED, &[1]);
            assert_eq!(set_off(arm, TARGET_POSITION, &[128]), 1);
            sleep(Duration::from_millis(300));
            let start = Instant::now();
            arm.write(SPEED, &[100]);
            arm.wait_until_still();
            arm.wait_until("joint 1 is there", |arm| near(arm.register(PRESENT_POSITION), 128));
            // 20 s were to go.
            start.elapsed() < Duration::from_secs(15)
        });
    });
}

/// D11: with speed 0 a move takes the time of the time register.
#[test]
fn d11_without_a_speed_a_move_takes_its_time() {
    with_arm(Setup::any(), |arm| {
        start_at(arm, 90);
        arm.write(SPEED, &[0]);
        arm.write(TIME, &[20]);
        assert_took(time_move(arm, 100), Duration::from_secs(2));
        assert_took(time_move(arm, 60), Duration::from_secs(2));
    });
}

/// D11: speed goes before time, and with neither a move is as fast as the motor.
#[test]
fn d11_speed_goes_before_time_and_nothing_is_faster_than_the_motor() {
    with_arm(Setup::any(), |arm| {
        start_at(arm, 90);
        arm.write(SPEED, &[100]);
        arm.write(TIME, &[100]);
        let mut target = 90;
        arm.wait_until("38 degrees at 190 degrees/s do not take 10 s", |arm| {
            target = if target == 90 { 128 } else { 90 };
            time_move(arm, target) < Duration::from_secs(9)
        });
        arm.write(TARGET_POSITION, &[128]);
        arm.wait_until_still();
        arm.write(SPEED, &[0]);
        for time in [0, 1] {
            arm.write(TIME, &[time]);
            // 74 degrees at 372 degrees/s take 0.2 s, whatever the time register asks for.
            assert_took(time_move(arm, 54), Duration::from_millis(200));
            assert_took(time_move(arm, 128), Duration::from_millis(200));
        }
    });
}

/// One frame, one start: the joints leave together, each at its own pace.
#[test]
fn d17_all_joints_of_a_pose_start_together() {
    with_arm(Setup::any(), |arm| {
        start_at(arm, 90);
        let pose: Vec<u8> =
            arm.positions().iter().map(|&at| if at > 60 { at - 20 } else { at + 20 }).collect();
        arm.write(SPEED, &[10, 20, 30, 40, 50, 60, 70]);
        let start = Instant::now();
        assert_eq!(set_off(arm, TARGET_POSITION, &pose), 0x7F);
        arm.wait_until_still();
        // The slowest needs 1.05 s.
        assert_took(start.elapsed(), Duration::from_millis(1_050));
        arm.wait_for_pose(&pose);
    });
}

/// D12: after power-up the measured positions are the targets, and nothing moves.
#[test]
fn d12_the_arm_starts_where_it_stands_and_holds_still() {
    with_arm(Setup::any().needs(Need::FreshArm), |arm| {
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(1) {
            let seen = arm.read(TARGET_POSITION, 15);
            assert_eq!(seen[..7], STANDARD_POSE, "targets");
            assert_eq!(seen[8..], STANDARD_POSE, "positions");
            assert_eq!(arm.register(MOVING_JOINTS), 0);
        }
    });
}

/// D12: power comes back while the arm is somewhere else, and it stays there.
#[test]
fn d12_after_a_power_cycle_the_arm_stays_where_it_was() {
    with_arm(Setup::any().needs(Need::PowerCycle), |arm| {
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

/// D12: the controller alone restarts, and no joint falls: each holds where it was. A servo that never answers makes
/// start-up last half a second, time enough to fall by 30 degrees.
#[test]
fn d12_after_a_restart_of_the_controller_the_arm_stays_where_it_was() {
    with_arm(Setup::any().needs(Need::PowerCycle).fault("7=missing"), |arm| {
        let mut pose = STANDARD_POSE;
        // Rear arm and forearm stretched out to the front: without torque, both fall.
        (pose[0], pose[1], pose[2]) = (130, 45, 80);
        let pose = &pose[..6];
        arm.wait_for_pose(&STANDARD_POSE[..6]);
        arm.write(TARGET_POSITION, pose);
        arm.wait_for_pose(pose);
        for _ in 0..3 {
            arm.restart_controller();
            arm.wait_for_pose(pose);
            sleep(Duration::from_millis(500));
            let (targets, positions) = (arm.read(TARGET_POSITION, 7), arm.positions());
            for (joint, &wanted) in pose.iter().enumerate() {
                let (target, is) = (targets[joint], positions[joint]);
                assert!(near(target, wanted) && near(is, wanted), "joint {}: {target}, {is}", joint + 1);
            }
            assert_eq!(arm.register(MOVING_JOINTS), 0);
        }
    });
}

/// D13: in damping and forceless nothing is driven; entering servo, the arm holds where it is.
#[test]
fn d13_without_servo_state_nothing_is_driven_and_positions_go_on_being_measured() {
    with_arm(Setup::any().supported(), |arm| {
        for state in [0, 2] {
            start_at(arm, 90);
            let here = arm.positions();
            arm.write(MOTOR_STATE, &[state]);
            arm.write(TARGET_POSITION, &[120]);
            sleep(Duration::from_millis(500));
            let there = arm.positions();
            let stayed = here.iter().zip(&there).all(|(before, after)| near(*after, *before));
            assert!(stayed, "in state {state} the arm went from {here:?} to {there:?}");
            arm.write(MOTOR_STATE, &[1]);
            let targets = arm.read(TARGET_POSITION, 7);
            let holds = targets.iter().zip(&there).all(|(target, at)| near(*target, *at));
            assert!(holds, "back in servo state it aims for {targets:?}, standing at {there:?}");
            assert_eq!(arm.register(MOVING_JOINTS), 0);
        }
    });
}

/// D13: the rest of the frame that enters servo state applies after the targets were set.
#[test]
fn d13_a_frame_that_enters_servo_state_may_bring_targets() {
    with_arm(Setup::any(), |arm| {
        start_at(arm, 90);
        arm.write(MOTOR_STATE, &[2]);
        let mut frame = arm.read(MOTOR_STATE, 24);
        frame[0] = 1;
        frame[usize::from(TARGET_POSITION - MOTOR_STATE)] = 120;
        let moving = set_off(arm, MOTOR_STATE, &frame);
        assert_eq!(moving & 1, 1, "joint 1 is on its way, though it has to be measured first");
        assert_eq!(arm.register(TARGET_POSITION), 120);
        arm.wait_until("joint 1 went there", |arm| near(arm.register(PRESENT_POSITION), 120));
    });
}

/// Takes so many reports, checks what they are, and that they did not come more often than `hertz`.
fn take_reports(arm: &mut Bench, start: Instant, count: u32, hertz: u32) {
    for _ in 0..count {
        let report = arm.reply();
        assert_eq!((report.address, report.values.len()), (PRESENT_POSITION, 7));
    }
    assert_took(start.elapsed(), Duration::from_secs(1) * (count - 1) / hertz);
}

/// D14: positions come unasked, as often as was asked for.
#[test]
fn d14_reports_come_at_their_rate_and_not_at_all_at_zero() {
    with_arm(Setup::any(), |arm| {
        let here = arm.positions();
        let start = Instant::now();
        arm.write(FEEDBACK_FREQUENCY, &[20]);
        let report = arm.reply();
        assert_eq!((report.address, report.values), (PRESENT_POSITION, here));
        take_reports(arm, start, 40, 20);
        arm.write(FEEDBACK_FREQUENCY, &[0]);
        arm.read(FEEDBACK_FREQUENCY, 1);
        assert_eq!(arm.reply_within(Duration::from_millis(500)), None);
        arm.expect_nothing_more();
    });
}

/// D14: answers come between reports, none lost, all in order.
#[test]
fn d14_answers_go_on_between_reports() {
    with_arm(Setup::any(), |arm| {
        arm.write(FEEDBACK_FREQUENCY, &[50]);
        for round in 0..100_u8 {
            arm.write(EFFECTOR_TYPE, &[round & 1]);
            assert_eq!(arm.register(EFFECTOR_TYPE), round & 1);
            sleep(Duration::from_millis(5));
        }
        take_reports(arm, Instant::now(), 1, 50);
        arm.write(FEEDBACK_FREQUENCY, &[0]);
    });
}

/// D14: reports take at most half the line: 34 Hz at 9600 baud.
#[test]
fn d14_reports_take_at_most_half_of_a_slow_line() {
    with_arm(Setup::any().needs(Need::PowerCycle).needs(Need::Persistence), |arm| {
        arm.write_setting(BAUD_RATE, &[7]);
        arm.power_cycle(9_600);
        let start = Instant::now();
        arm.write(FEEDBACK_FREQUENCY, &[50]);
        // At 50 Hz they would take 2 s.
        take_reports(arm, start, 103, 34);
        // Half the line is free, so answers come.
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 50, "the register keeps what was written");
    });
}

/// D18: registers are whole degrees from 0 to 180, also where the joint stands beyond.
#[test]
fn d18_positions_end_at_0_and_180() {
    with_arm(Setup::any().needs(Need::FreshArm), |arm| {
        for (end, offset, beyond) in [(180, 10, 180), (0, 0x8A, 0)] {
            start_at(arm, end);
            arm.write(MOTOR_STATE, &[2]);
            arm.write_setting(OFFSET, &[offset]);
            arm.wait_until("the end shows", |arm| arm.register(PRESENT_POSITION) == beyond);
            arm.write_setting(OFFSET, &[0]);
            arm.write(MOTOR_STATE, &[1]);
        }
    });
}
