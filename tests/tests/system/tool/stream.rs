//! `sevenbot stream`: set-points from standard input, and what happens when the program dies.

use std::io::{Read, Write};
use std::process::{ChildStdin, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::output::{all_output, failed, succeeded};
use system_tests::process::{RunningProgram, Signal, send_signal, start, wait_for_exit};
use system_tests::programs::{host_sim, tool};
use system_tests::registers::{
    FAULTS, FEEDBACK_FREQUENCY, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION, SPEED, STANDARD_POSE,
    TARGET_POSITION,
};
use system_tests::{TestArm, TestSetup, near, with_arm};

/// First of seven fine targets, two bytes each.
const FINE_TARGET: u8 = 128;
/// Set-point period (two bytes), time and action of the watchdog, limits, content of the reports.
const STREAM_REGISTERS: u8 = 184;
/// The fault bit that tells that the host-link watchdog acted (D24).
const HOST_SILENT: u8 = 1 << 6;
/// Longer than the watchdog of the tool, 300 ms.
const SILENCE: Duration = Duration::from_secs(1);
/// After this time the joint is in motion and has not arrived.
const UNDER_WAY: Duration = Duration::from_millis(500);

/// Starts `sevenbot stream` with these options. The test writes its standard input.
fn start_stream(arm: &mut TestArm, options: &[&str]) -> RunningProgram {
    let mut tool = tool();
    tool.arg("--port").arg(arm.lend_port()).arg("stream").args(options).stdin(Stdio::piped());
    RunningProgram::spawn(tool.stdout(Stdio::piped()).stderr(Stdio::piped()))
}

/// Starts `sevenbot stream` with a point far away, and waits until the first point is sent. Joint 1 turns at 3 degrees/s, so
/// that it moves for 20 s.
fn start_slow_stream(arm: &mut TestArm) -> (RunningProgram, ChildStdin) {
    arm.write(SPEED, &[5]);
    assert_eq!(arm.register(SPEED), 5);
    let mut tool = start_stream(arm, &["--verbose"]);
    let mut lines = tool.stdin.take().expect("a pipe");
    lines.write_all(b"0,90,90,65,90,90,90,80\n20,150,90,65,90,90,90,80\n").expect("the tool reads");
    wait_for_point(&mut tool);
    sleep(UNDER_WAY);
    (tool, lines)
}

/// Waits until a tool with `--verbose` has sent a point.
fn wait_for_point(tool: &mut RunningProgram) {
    let mut stderr = tool.stderr.take().expect("a pipe");
    let mut received = Vec::new();
    while !String::from_utf8_lossy(&received).contains("-> write fine-target") {
        let mut chunk = [0; 256];
        let length = stderr.read(&mut chunk).expect("text");
        assert_ne!(length, 0, "ended:\n{}", String::from_utf8_lossy(&received));
        received.extend(&chunk[..length]);
    }
    tool.stderr = Some(stderr);
}

/// Waits until the watchdog of a program that was killed has acted.
fn wait_for_watchdog(arm: &mut TestArm) {
    arm.wait_until("the watchdog acts", |arm| {
        // The reads of this test also feed the watchdog.
        sleep(SILENCE);
        arm.register(FAULTS) & HOST_SILENT != 0
    });
}

/// Runs `sevenbot stream` on these lines.
fn stream(arm: &mut TestArm, options: &[&str], lines: &str) -> Output {
    let mut tool = start_stream(arm, options);
    tool.stdin.take().expect("a pipe").write_all(lines.as_bytes()).expect("the tool reads");
    let output = tool.output();
    arm.reopen(115_200);
    output
}

#[test]
fn a_stream_tells_which_joints_are_slow() {
    with_arm(TestSetup::any(), |arm| {
        arm.write(SPEED, &[5]);
        let text = all_output(&stream(arm, &[], "0,90,90,65,90,90,90,80\n"));
        assert!(text.contains("joint 1: 9.5 degrees/s, as the registers of speed"), "{text}");
        arm.write(SPEED, &[60]);
        let text = all_output(&stream(arm, &[], "0,90,90,65,90,90,90,80\n"));
        assert!(!text.contains("the registers of speed"), "{text}");
    });
}

fn fine_target(arm: &mut TestArm, joint: u8) -> u16 {
    arm.counter(FINE_TARGET + 2 * (joint - 1))
}

#[test]
fn d23_points_of_both_forms_move_the_arm_in_hundredths() {
    with_arm(TestSetup::any(), |arm| {
        arm.write(STREAM_REGISTERS, &[50, 0]);
        let lines = "{\"t\": 0, \"joints\": [90, null, 65, 90, 90, 90, 80]}\n\
                     {\"t\": 0.5, \"joints\": [100.25, null, 65, 90, 90, 90, 80]}\n\
                     1.0, 95.5, , 60.01, 90, 90, 90, 80\n";
        let text = succeeded(stream(arm, &["--json"], lines));
        assert!(text.starts_with("{\"points\":") && text.contains("\"rms_degrees\":"), "{text}");
        assert!(text.contains("\"refused\":0"), "{text}");
        assert_eq!([1, 2, 3].map(|joint| fine_target(arm, joint)), [9_550, 9_000, 6_001]);
        assert_eq!(arm.register(MOVING_JOINTS), 0, "the tool waits for the arrival");
        assert_eq!(arm.read(STREAM_REGISTERS, 6), [50, 0, 0, 0, 0, 0], "as before");
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0);
        arm.write(STREAM_REGISTERS, &[0, 0]);
        let text = succeeded(stream(arm, &["--period", "40", "--approach", "1"], "0,90,90,65,90,90,90,80\n"));
        assert!(text.contains("sent      1 points, one each 40 ms") && text.contains("jitter"), "{text}");
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn a_first_point_far_away_is_refused_unless_it_is_approached() {
    with_arm(TestSetup::any(), |arm| {
        arm.drive_to(&STANDARD_POSE);
        // The speed that `pose --time` leaves behind.
        arm.write(SPEED, &[0; 7]);
        let far = "0,150,90,65,90,90,90,20\n";
        let text = failed(&stream(arm, &[], far), 1);
        assert!(text.contains("from 150.00°") && text.contains("joint 7 is at"), "{text}");
        assert!(text.contains("--approach SECONDS"), "the way out: {text}");
        assert_eq!(
            (arm.read(TARGET_POSITION, 7), arm.read(STREAM_REGISTERS, 4)),
            (STANDARD_POSE.to_vec(), vec![0; 4])
        );
        let begin = Instant::now();
        succeeded(stream(arm, &["--approach", "1.5"], far));
        assert!(begin.elapsed() >= Duration::from_millis(1500));
        assert_eq!([1, 7].map(|joint| fine_target(arm, joint)), [15_000, 2_000]);
        // Joint 2 has its first point in the second line.
        let later = "0,150,,65,90,90,90,20\n0.1,150,60,65,90,90,90,20\n0.2,150,60,65,90,90,90,20\n";
        let text = failed(&stream(arm, &[], later), 1);
        assert!(text.contains("joint 2 is at"), "{text}");
        arm.write(SPEED, &[60; 7]);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn a_bad_line_is_named_and_the_points_before_it_stay() {
    with_arm(TestSetup::any(), |arm| {
        let lines =
            "t,j1,j2,j3,j4,j5,j6,j7\n0,90,90,65,90,90,90,80\n0.2,92.5,90,65,90,90,90,80\n0.4,x,,,,,,\n";
        let text = failed(&stream(arm, &[], lines), 1);
        assert!(text.contains("standard input: line 4: `x` is not a number"), "{text}");
        assert_eq!(fine_target(arm, 1), 9_250);
        assert_eq!((arm.register(MOTOR_STATE), arm.read(STREAM_REGISTERS, 4)), (1, vec![0; 4]));
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn d24_a_killed_stream_leaves_an_arm_that_holds_and_takes_the_next_client() {
    with_arm(TestSetup::any(), |arm| {
        let (mut killed, _lines) = start_slow_stream(arm);
        send_signal(&killed, Signal::KILL);
        wait_for_exit(&mut killed);
        arm.reopen(115_200);
        wait_for_watchdog(arm);
        let held = fine_target(arm, 1);
        assert!(held < 15_000, "on its way: {held}");
        assert_eq!((arm.register(MOVING_JOINTS), arm.register(MOTOR_STATE)), (0, 1));
        arm.wait_until("joint 1 is at its set-point", |arm| {
            let target = arm.register(TARGET_POSITION);
            near(arm.register(PRESENT_POSITION), target)
        });
        assert_eq!(fine_target(arm, 1), held, "it holds there");
        let others = arm.read(PRESENT_POSITION + 1, 6);
        assert!(
            others.iter().zip(&STANDARD_POSE[1..]).all(|(now, was)| near(*now, *was)),
            "nothing fell: {others:?}"
        );
        arm.write(SPEED, &[60]);
        let next = stream(arm, &["--approach", "1"], "0,90,90,65,90,90,90,80\n1,90.5,90,65,90,90,90,80\n");
        assert_eq!(next.status.code(), Some(0), "{}", all_output(&next));
        assert_eq!(fine_target(arm, 1), 9_050);
        assert_eq!(arm.read(STREAM_REGISTERS, 4), [0; 4], "what the dead program left is switched off");
        assert_eq!(arm.register(FAULTS) & HOST_SILENT, 0);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn d24_the_watchdog_of_a_killed_stream_does_not_stop_what_comes_after() {
    with_arm(TestSetup::any(), |arm| {
        let (mut killed, _lines) = start_slow_stream(arm);
        send_signal(&killed, Signal::KILL);
        wait_for_exit(&mut killed);
        sleep(SILENCE);
        let set = tool().arg("--port").arg(arm.lend_port()).args(["set", "target-position.1", "80"]).output();
        succeeded(set.expect("sevenbot runs"));
        // The joint needs a second or more. Nothing is sent meanwhile.
        sleep(SILENCE);
        arm.reopen(115_200);
        assert_eq!((arm.register(TARGET_POSITION), arm.register(FAULTS) & HOST_SILENT), (80, 0));
        assert_eq!(arm.read(STREAM_REGISTERS, 4), [0; 4], "what the dead program left is switched off");
        arm.write(SPEED, &[60]);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn d24_a_killed_stream_can_leave_the_arm_damped() {
    with_arm(TestSetup::any(), |arm| {
        let mut killed = start_stream(arm, &["--watchdog-action", "damping", "--verbose"]);
        let point = b"0,90,90,65,90,90,90,80\n";
        killed.stdin.as_mut().expect("a pipe").write_all(point).expect("the tool reads");
        wait_for_point(&mut killed);
        send_signal(&killed, Signal::KILL);
        wait_for_exit(&mut killed);
        arm.reopen(115_200);
        wait_for_watchdog(arm);
        assert_eq!(arm.register(MOTOR_STATE), 0);
        arm.write(STREAM_REGISTERS, &[0; 4]);
        arm.write(MOTOR_STATE, &[1]);
        arm.wait_until("the arm is driven", |arm| arm.register(MOTOR_STATE) == 1);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn d24_ctrl_c_holds_the_arm_and_puts_the_registers_back() {
    with_arm(TestSetup::any(), |arm| {
        let (tool, _lines) = start_slow_stream(arm);
        send_signal(&tool, Signal::INT);
        let text = failed(&tool.output(), 130);
        assert!(text.contains("the arm holds where it is"), "{text}");
        arm.reopen(115_200);
        arm.wait_until_still();
        assert!(fine_target(arm, 1) < 15_000);
        assert_eq!(arm.read(STREAM_REGISTERS, 6), [0; 6]);
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0);
        arm.write(SPEED, &[60]);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn an_arm_of_the_maker_takes_no_stream() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let link = folder.path().join("7bot");
    let mut command = std::process::Command::new(host_sim());
    command
        .args(["--as-maker", "2.1.4", "--eeprom"])
        .arg(folder.path().join("eeprom.bin"))
        .arg("--link")
        .arg(&link);
    let _simulator = start(&mut command, 1).expect("a simulator");
    let output =
        tool().arg("--port").arg(&link).arg("stream").stdin(Stdio::null()).output().expect("sevenbot runs");
    let text = failed(&output, 1);
    assert!(text.contains("takes no stream of set-points: it has whole degrees only"), "{text}");
}
