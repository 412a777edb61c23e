//! `sevenbot calibrate`: offsets found, written, reset, and still there after a restart.

mod said;

use std::io::Write;
use std::process::{Output, Stdio};

use said::{done, failed, said, words};
use system_tests::own::{OwnArm, World};
use system_tests::programs::{sevenbot, tool};
use system_tests::registers::{EEPROM_LOCK, MOTOR_STATE, OFFSET};
use system_tests::target::Target;
use system_tests::terminal::Terminal;
use system_tests::{Bench, Need, Setup, near, with_arm};

/// The tool with lines for it to read.
fn with_input(arm: &mut Bench, arguments: &[&str], input: &str) -> Output {
    let mut tool = tool();
    tool.arg("--port").arg(arm.lend_port()).args(arguments);
    let tool = tool.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut tool = tool.expect("sevenbot runs");
    let mut lines = tool.stdin.take().expect("a pipe");
    lines.write_all(input.as_bytes()).expect("it reads");
    drop(lines);
    let output = tool.wait_with_output().expect("it ends");
    arm.reopen(115_200);
    output
}

#[test]
fn calibration_makes_joints_read_what_they_really_are() {
    with_arm(Setup::any().supported().needs(Need::Persistence), |arm| {
        // Forceless, no joint goes anywhere: what changes is only the reading.
        arm.write(MOTOR_STATE, &[2]);
        let walk = "nonsense\n+5\n93\n100\n87\n\n\n\n\n\n";
        let output = with_input(arm, &["calibrate", "--yes"], walk);
        let said = said(&output);
        let text = done(output);
        assert!(said.contains("forceless"), "why +5 did nothing: {said}");
        assert_eq!(words(&text, "1 "), ["1", "3°", "good", "(was", "0°)"]);
        // Mounted the other way round, the offset counts on the servo's side.
        assert_eq!(words(&text, "2 "), ["2", "-10°", "good", "(was", "0°)"]);
        assert!(said.contains("bad"), "22 degrees are too much: {said}");
        assert_eq!(words(&text, "3 "), ["3", "0°", "good"]);
        let positions = arm.positions();
        assert!(near(positions[0], 93) && near(positions[1], 100), "{positions:?}");
    });
}

#[test]
fn calibration_shows_and_resets_and_wants_somebody_to_answer() {
    with_arm(Setup::any(), |arm| {
        arm.write_setting(OFFSET, &[0x85, 12, 0, 0, 0, 0, 0]);
        let text = done(arm.sevenbot(&["calibrate", "--show"]));
        assert_eq!(words(&text, "1 "), ["1", "-5°", "good"]);
        assert_eq!(words(&text, "2 "), ["2", "12°", "acceptable"]);
        let text = failed(&arm.sevenbot(&["calibrate", "--reset"]), 2);
        assert!(text.contains("nobody is there"), "{text}");
        let text = failed(&with_input(arm, &["calibrate", "--yes"], "\n95\n"), 2);
        assert!(text.contains("the input has ended"), "{text}");
        assert_eq!(arm.read(OFFSET, 7), [0x85, 12, 0, 0, 0, 0, 0], "nothing was written");
        done(arm.sevenbot(&["calibrate", "--reset", "--yes"]));
        assert_eq!(arm.read(OFFSET, 7), [0; 7]);
        assert_eq!(arm.register(EEPROM_LOCK), 1, "closed again");
    });
}

/// The tool in a terminal, on an arm that nobody else has open.
fn at_terminal(arm: &OwnArm, arguments: &[&str]) -> Terminal {
    let port = arm.port().to_str().expect("UTF-8");
    Terminal::run(sevenbot(), &[&["--port", port, "calibrate"], arguments].concat())
}

#[test]
fn offsets_are_looked_for_again_after_a_restart() {
    // One of its own: the tool is not alone with it, somebody has to switch it off and on.
    let mut arm = OwnArm::start(World::Simulator, Vec::new());
    let mut walk = at_terminal(&arm, &[]);
    walk.wait_for("joint 1: reads 90°");
    walk.keys("93\r");
    for joint in 2..=7 {
        walk.wait_for(&format!("joint {joint}:"));
        walk.keys("\r");
    }
    walk.wait_for("Write these offsets?");
    walk.keys("y\r");
    walk.wait_for("switch the arm off and on");
    arm.power_cycle();
    walk.keys("\r");
    let screen = walk.wait_for("the offsets are still there");
    assert!(!screen.contains("not switched off"), "{screen}");
    assert!(walk.wait().success(), "{}", walk.shows());

    let mut reset = at_terminal(&arm, &["--reset"]);
    reset.wait_for("Write these offsets?");
    reset.keys("y\r");
    reset.wait_for("switch the arm off and on");
    reset.keys("\r");
    reset.wait_for("the arm was not switched off");
    assert!(reset.wait().success(), "{}", reset.shows());
}

#[test]
fn ctrl_c_at_a_question_ends_it_at_once() {
    let arm = OwnArm::start(World::Simulator, Vec::new());
    let mut walk = at_terminal(&arm, &[]);
    walk.wait_for("joint 1: reads 90°");
    walk.keys("+2\r");
    walk.wait_for("joint 1: reads 92°");
    walk.keys("\x03");
    assert_eq!(walk.wait().code(), Some(130), "{}", walk.shows());
}
