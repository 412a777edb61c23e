//! The commands that move the arm, also when they are interrupted.

use std::io::{BufRead, BufReader};
use std::process::ChildStderr;
use std::time::Duration;

use super::output::{all_output, failed, succeeded, words};
use system_tests::arm_control::ArmControl;
use system_tests::process::{RunningProgram, Signal, send_signal};
use system_tests::programs::tool;
use system_tests::registers::{
    EFFECTOR_TYPE, LIMITS, MOTOR_STATE, PRESENT_POSITION, SPEED, STANDARD_POSE, TARGET_POSITION, TIME,
};
use system_tests::started_arm::{ArmKind, StartedArm};
use system_tests::wait::{wait_for, wait_until};
use system_tests::{ArmClient, Need, TestArm, TestSetup, near, with_arm};

/// A pose far from the standard one.
const FAR: [&str; 7] = ["170", "90", "65", "90", "90", "90", "80"];

/// A pace at which the way to the far pose takes some time.
const SLOW: [&str; 2] = ["--speed", "5"];

/// Starts a move to a far pose, and waits until the arm moves.
fn start_slow_move(arm: &mut TestArm, pace: [&str; 2]) -> (RunningProgram, BufReader<ChildStderr>) {
    let mut tool = arm.spawn_sevenbot(&[&["--verbose", "pose", "--wait"][..], &pace, &FAR].concat());
    let mut frames = BufReader::new(tool.stderr.take().expect("a pipe"));
    let (mut line, mut text) = (String::new(), String::new());
    while !line.contains("moving-joints = 1 ") {
        text.push_str(&line);
        line.clear();
        assert_ne!(frames.read_line(&mut line).expect("text"), 0, "ended before the arm moved:\n{text}");
    }
    (tool, frames)
}

/// Waits for the end of the tool. Returns the rest of its standard error without frames, and its exit status.
fn end((mut tool, mut frames): (RunningProgram, BufReader<ChildStderr>)) -> (String, Option<i32>) {
    let mut text = String::new();
    std::io::Read::read_to_string(&mut frames, &mut text).expect("text");
    let lines = text.lines().filter(|line| !line.contains("->") && !line.contains("<-"));
    (lines.collect::<Vec<_>>().join("\n"), tool.wait().expect("the tool ends").code())
}

#[test]
fn a_pose_may_contain_steps_and_omit_joints() {
    with_arm(TestSetup::any(), |arm| {
        arm.write(SPEED, &[0; 7]);
        arm.write(TIME, &[0; 7]);
        succeeded(arm.sevenbot(&["pose", "+20", "_", "-5", ".", "_", "_", "70", "--speed", "100", "--wait"]));
        assert_eq!(arm.read(TARGET_POSITION, 7), [110, 90, 60, 90, 90, 90, 70]);
        assert_eq!((arm.read(SPEED, 7), arm.read(TIME, 7)), (vec![0; 7], vec![0; 7]), "put back");
        succeeded(arm.sevenbot(&["pose", "_", "_", "+0", ".", "_", "_", "70", "--speed", "100"]));
        assert_eq!(arm.read(SPEED, 7), [0, 0, 100, 0, 0, 0, 100], "only the speeds of joints that move");
        succeeded(arm.sevenbot(&["pose", "-10", "_", "_", "_", "_", "_", "_", "--wait"]));
        assert_eq!(arm.register(TARGET_POSITION), 100);
        let text = failed(&arm.sevenbot(&["pose", "+81", "_", "_", "_", "_", "_", "1"]), 1);
        assert!(text.contains("joint 1 would go to 181°"), "{text}");
        assert_eq!(arm.read(TARGET_POSITION, 7), [100, 90, 60, 90, 90, 90, 70], "no target was written");
        let text = failed(&arm.sevenbot(&["pose", "+1", "x", "_", "_", "_", "_", "_"]), 2);
        assert!(text.contains("degrees from 0 to 180"), "{text}");
        assert!(
            succeeded(arm.sevenbot(&["home", "--wait", "--json"])).starts_with("{\"positions_degrees\":[")
        );
        assert_eq!(arm.read(TARGET_POSITION, 7), STANDARD_POSE);
    });
}

#[test]
fn stop_holds_the_position_of_the_arm() {
    with_arm(TestSetup::any(), |arm| {
        succeeded(arm.sevenbot(&[["pose", "--speed", "5"].as_slice(), &FAR].concat()));
        arm.wait_until("the arm moves", |arm| arm.register(PRESENT_POSITION) > 92);
        let text = succeeded(arm.sevenbot(&["stop"]));
        let held: u8 = text.split_whitespace().next().expect("degrees").parse().expect("degrees");
        assert!((90..165).contains(&held), "{text}");
        assert_eq!(arm.register(TARGET_POSITION), held);
        arm.wait_until_still();
        arm.wait_until("joint 1 is at rest", |arm| near(arm.register(PRESENT_POSITION), held));
    });
}

#[test]
fn d25_stop_holds_an_arm_whose_joints_are_measured_outside_the_linkage() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&[90, 150, 76, 90, 90, 90, 80]);
        arm.write(LIMITS, &[1]);
        // While joint 2 makes room for joint 3, it is measured some degrees behind its set-point.
        arm.write(SPEED, &[5; 7]);
        arm.write(TARGET_POSITION, &[10, 76, 150]);
        arm.wait_until("the arm moves", |arm| arm.register(PRESENT_POSITION) < 86);
        succeeded(arm.sevenbot(&["stop"]));
        arm.wait_until_still();
        assert!(arm.register(PRESENT_POSITION) > 12, "it was not stopped");
    });
}

#[test]
fn stop_does_not_move_a_joint_without_a_servo() {
    with_arm(TestSetup::any().fault("3=missing"), |arm| {
        arm.wait_until("the missing servo is reported", |arm| arm.register(242) == 0b100);
        let text = failed(&arm.sevenbot(&["stop"]), 1);
        assert!(text.contains("joint 3 does not answer") && text.contains("before you reach"), "{text}");
        // The register reads 0 because the position was never measured. This 0 must not become the target.
        assert_eq!(arm.register(PRESENT_POSITION + 2), 0);
        assert_eq!(arm.register(TARGET_POSITION + 2), STANDARD_POSE[2]);
    });
}

/// Runs the tool with an arm that may not have started yet.
#[track_caller]
fn run(arm: &StartedArm, arguments: &[&str]) -> String {
    let mut tool = tool();
    succeeded(tool.arg("--port").arg(arm.port()).args(arguments).output().expect("sevenbot runs"))
}

#[test]
fn stop_waits_for_an_arm_that_was_just_switched_on() {
    // The test does not wait until this arm has started.
    let mut arm = StartedArm::start(ArmKind::Simulator, Vec::new());
    // The level forearm droops by about half a degree as soon as it has torque, so joint 3 may read 66.
    let held = run(&arm, &["stop"]);
    let is_standard = ["90 90 65 90 90 90 80\n", "90 90 66 90 90 90 80\n"].contains(&held.as_str());
    assert!(is_standard, "not 0, the value before the first reading: {held}");
    run(&arm, &["pose", "120", "90", "65", "90", "90", "90", "80", "--wait"]);
    restart(&mut arm);
    let text = move_by_10_degrees(&arm);
    let position: u8 = text.split_whitespace().next().expect("degrees").parse().expect("degrees");
    assert!(near(position, 130), "from its present position: {text}");
}

/// Switches the arm off and on, and waits until it has started. It may not have read its servos yet.
pub(super) fn restart(arm: &mut StartedArm) {
    let mut client = ArmClient::open(arm.port(), 115_200);
    client.write(EFFECTOR_TYPE, &[1]);
    assert_eq!(client.read(EFFECTOR_TYPE, 1), [1], "the mark before a restart");
    arm.power_cycle();
    let timeout = Duration::from_millis(500);
    wait_until("the arm has started", || client.try_read(EFFECTOR_TYPE, 1, timeout) == Some(vec![0]));
}

/// Moves joint 1 by 10 degrees. On a busy machine its servo may be missing for a while: then the tool must not move the arm,
/// and this function runs it again.
fn move_by_10_degrees(arm: &StartedArm) -> String {
    wait_for("the tool moves joint 1", || {
        let mut tool = tool();
        let arguments = ["pose", "+10", "_", "_", "_", "_", "_", "_", "--wait"];
        let output = tool.arg("--port").arg(arm.port()).args(arguments).output().expect("sevenbot runs");
        if output.status.success() {
            return Ok(succeeded(output));
        }
        let text = failed(&output, 1);
        assert!(text.contains("nothing was moved"), "{text}");
        Err(text)
    })
}

#[test]
fn zero_degrees_is_a_position() {
    with_arm(TestSetup::any(), |arm| {
        succeeded(arm.sevenbot(&["pose", "0", "_", "_", "_", "_", "_", "_", "--speed", "100", "--wait"]));
        let text = succeeded(arm.sevenbot(&["stop"]));
        let held: u8 = text.split_whitespace().next().expect("degrees").parse().expect("degrees");
        assert!(near(held, 0), "{text}");
        assert_eq!(arm.register(TARGET_POSITION), held);
        succeeded(arm.sevenbot(&["pose", "0", "_", "_", "_", "_", "_", "_", "--wait"]));
        succeeded(arm.sevenbot(&["pose", "+10", "_", "_", "_", "_", "_", "_", "--wait"]));
        assert_eq!(arm.register(TARGET_POSITION), 10);
    });
}

#[test]
fn ctrl_c_holds_the_position_of_the_arm() {
    with_arm(TestSetup::any(), |arm| {
        for pace in [SLOW, ["--time", "8s"]] {
            let tool = start_slow_move(arm, pace);
            send_signal(&tool.0, Signal::INT);
            let (text, status) = end(tool);
            assert_eq!(status, Some(130), "{text}");
            assert!(text.contains("the arm holds where it is"), "{text}");
            assert!(!text.contains("warning") && !text.contains("waits"), "{text}");
            arm.reopen(115_200);
            let held = arm.register(TARGET_POSITION);
            assert!(held < 165, "held at {held}");
            assert_eq!((arm.read(SPEED, 7), arm.read(TIME, 7)), (vec![60; 7], vec![0; 7]), "put back");
            arm.wait_until_still();
            arm.wait_until("joint 1 is at rest", |arm| near(arm.register(PRESENT_POSITION), held));
        }
    });
}

#[test]
fn a_speed_that_a_killed_command_left_is_told_by_the_next_move() {
    with_arm(TestSetup::any(), |arm| {
        let (mut tool, _) = start_slow_move(arm, SLOW);
        tool.kill();
        let text = all_output(&arm.sevenbot(&["pose", "91", "90", "65", "90", "90", "90", "80"]));
        assert!(
            text.contains("joints 1, 2, 3, 4, 5, 6 and 7: 9.5 degrees/s, as the registers of speed"),
            "{text}"
        );
        succeeded(arm.sevenbot(&["set", "speed", "60"]));
        let text = all_output(&arm.sevenbot(&["home", "--wait"]));
        assert!(!text.contains("the registers"), "{text}");
    });
}

#[test]
fn a_lost_connection_ends_a_wait_with_an_error() {
    with_arm(TestSetup::any().needs(Need::Kill), |arm| {
        let tool = start_slow_move(arm, SLOW);
        arm.kill_and_restart();
        let (text, status) = end(tool);
        assert_eq!(status, Some(3), "{text}");
        assert!(text.contains("the connection is gone") && text.contains("was the cable pulled"), "{text}");
        assert!(text.contains("the arm may be moving"), "{text}");
        assert!(!text.contains("panicked"), "{text}");
    });
}

#[test]
fn state_needs_a_confirmation_before_the_arm_falls() {
    with_arm(TestSetup::any(), |arm| {
        assert_eq!(words(&succeeded(arm.sevenbot(&["state"])), "29")[2..], ["1", "servo"]);
        let text = failed(&arm.sevenbot(&["state", "forceless"]), 2);
        assert!(text.contains("fall") && text.contains("--yes"), "{text}");
        assert_eq!(arm.register(MOTOR_STATE), 1);
        succeeded(arm.sevenbot(&["state", "forceless", "--yes"]));
        assert_eq!(arm.register(MOTOR_STATE), 2);
        succeeded(arm.sevenbot(&["state", "damping"]));
        assert_eq!(arm.register(MOTOR_STATE), 0, "without a confirmation: the arm had no torque");
        succeeded(arm.sevenbot(&["state", "servo"]));
        assert_eq!(arm.register(MOTOR_STATE), 1);
    });
}
