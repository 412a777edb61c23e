//! `sevenbot calibrate`: offsets are determined, written, reset and kept over a restart.

use std::io::Write;
use std::process::{Output, Stdio};

use super::moving::restart;
use super::output::{all_output, failed, succeeded, words};
use system_tests::arm_control::ArmControl;
use system_tests::process::RunningProgram;
use system_tests::programs::{sevenbot, tool};
use system_tests::registers::{EEPROM_LOCK, MOTOR_STATE, OFFSET, STANDARD_POSE, TARGET_POSITION};
use system_tests::started_arm::{ArmKind, StartedArm};
use system_tests::terminal::Terminal;
use system_tests::{Need, TestArm, TestSetup, near, with_arm};

/// Runs the tool with this text on its standard input.
fn with_input(arm: &mut TestArm, arguments: &[&str], input: &str) -> Output {
    let mut tool = tool();
    tool.arg("--port").arg(arm.lend_port()).args(arguments);
    tool.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut tool = RunningProgram::spawn(&mut tool);
    let mut lines = tool.stdin.take().expect("a pipe");
    lines.write_all(input.as_bytes()).expect("the tool reads");
    drop(lines);
    let output = tool.output();
    arm.reopen(115_200);
    output
}

#[test]
fn calibration_corrects_the_measured_angles() {
    with_arm(TestSetup::any().supported().needs(Need::Persistence), |arm| {
        // Forceless, so that no joint moves and only the readings change.
        arm.write(MOTOR_STATE, &[2]);
        let answers = "nonsense\n+5\n93\n100\n87\n\n\n\n\n\n";
        let output = with_input(arm, &["calibrate", "--yes"], answers);
        let all = all_output(&output);
        let text = succeeded(output);
        assert!(all.contains("forceless"), "the reason why +5 has no effect: {all}");
        assert_eq!(words(&text, "1 "), ["1", "3°", "good", "(was", "0°)"]);
        // Joint 2 is mounted in reverse, and its offset has the sign of the servo.
        assert_eq!(words(&text, "2 "), ["2", "-10°", "good", "(was", "0°)"]);
        assert!(all.contains("bad"), "22 degrees are too much: {all}");
        assert_eq!(words(&text, "3 "), ["3", "0°", "good"]);
        let positions = arm.positions();
        assert!(near(positions[0], 93) && near(positions[1], 100), "{positions:?}");
    });
}

#[test]
fn calibration_shows_and_resets_offsets_and_needs_answers() {
    with_arm(TestSetup::any(), |arm| {
        arm.write_setting(OFFSET, &[0x85, 12, 0, 0, 0, 0, 0]);
        let text = succeeded(arm.sevenbot(&["calibrate", "--show"]));
        assert_eq!(words(&text, "1 "), ["1", "-5°", "good"]);
        assert_eq!(words(&text, "2 "), ["2", "12°", "acceptable"]);
        let text = failed(&arm.sevenbot(&["calibrate", "--reset"]), 2);
        assert!(text.contains("standard input is no terminal"), "{text}");
        let text = failed(&with_input(arm, &["calibrate", "--yes"], "\n95\n"), 2);
        assert!(text.contains("the input has ended"), "{text}");
        assert_eq!(arm.read(OFFSET, 7), [0x85, 12, 0, 0, 0, 0, 0], "nothing was written");
        let output = arm.sevenbot(&["calibrate", "--reset", "--yes"]);
        assert_eq!(all_output(&output).matches("offset").count(), 1, "one table: {}", all_output(&output));
        succeeded(output);
        assert_eq!(arm.read(OFFSET, 7), [0; 7]);
        assert_eq!(arm.register(EEPROM_LOCK), 1, "closed again");
    });
}

#[test]
fn a_step_out_of_range_is_refused() {
    with_arm(TestSetup::any(), |arm| {
        let output = with_input(arm, &["calibrate", "--yes"], "+200\n-1000\nq\n");
        let text = failed(&output, 1);
        assert!(text.contains("joint 1 would go to 290°: it takes 0 to 180"), "{text}");
        assert!(text.contains("joint 1 would go to -910°"), "{text}");
        assert_eq!(arm.register(TARGET_POSITION), STANDARD_POSE[0], "nothing was moved");
    });
}

fn calibrate_in_terminal(arm: &StartedArm, arguments: &[&str]) -> Terminal {
    let port = arm.port().to_str().expect("UTF-8");
    Terminal::run(sevenbot(), &[&["--port", port, "calibrate"], arguments].concat())
}

#[test]
fn offsets_are_verified_after_a_restart() {
    // The arm is switched off and on while the tool has its port open.
    let mut arm = StartedArm::start(ArmKind::Simulator, Vec::new());
    let mut terminal = calibrate_in_terminal(&arm, &[]);
    terminal.wait_for("joint 1: reads 90°");
    terminal.keys("93\r");
    for joint in 2..=7 {
        terminal.wait_for(&format!("joint {joint}:"));
        terminal.keys("\r");
    }
    terminal.wait_for("Write these offsets?");
    terminal.keys("y\r");
    terminal.wait_for("switch the arm off and on");
    restart(&mut arm);
    terminal.keys("\r");
    let screen = terminal.wait_for("the arm kept the offsets");
    assert!(!screen.contains("not switched off"), "{screen}");
    assert!(terminal.wait().success(), "{}", terminal.contents());

    let mut reset = calibrate_in_terminal(&arm, &["--reset"]);
    reset.wait_for("Write these offsets?");
    reset.keys("y\r");
    reset.wait_for("switch the arm off and on");
    reset.keys("\r");
    reset.wait_for("the arm was not switched off");
    assert!(reset.wait().success(), "{}", reset.contents());
}

#[test]
fn ctrl_c_at_a_prompt_ends_the_tool() {
    let arm = StartedArm::start(ArmKind::Simulator, Vec::new());
    let mut terminal = calibrate_in_terminal(&arm, &[]);
    terminal.wait_for("joint 1: reads 90°");
    terminal.keys("+2\r");
    terminal.wait_for("joint 1: reads 92°");
    terminal.keys("\x03");
    assert_eq!(terminal.wait().code(), Some(130), "{}", terminal.contents());
}
