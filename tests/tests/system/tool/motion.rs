//! `sevenbot record` and `play`: recordings of moves.

use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use super::output::{all_output, failed, succeeded};
use system_tests::process::{RunningProgram, Signal, send_signal};
use system_tests::programs::sevenbot;
use system_tests::registers::{
    FEEDBACK_FREQUENCY, MOTOR_STATE, SPEED, STANDARD_POSE, TARGET_POSITION, VACUUM_PUMP,
};
use system_tests::terminal::Terminal;
use system_tests::wait::wait_until;
use system_tests::{TestArm, TestSetup, near, with_arm};
use tempfile::TempDir;

/// A recording: joint 1 moves by 30 degrees and back, and the pump is switched on.
pub(super) const WAVE: &str = "\
7bot-recording 1
# by hand
0.0  90 90 65 90 90 90 80  0
0.5 120 80 65 90 90 90 80  1
1.0  90 90 65 90 90 90 80  1
";

/// A path in a new folder, with a file unless the text is empty.
pub(super) fn file(name: &str, text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    if !text.is_empty() {
        fs::write(&path, text).expect("a file");
    }
    (folder, path)
}

pub(super) fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// The numbers in each moment of a recording.
pub(super) fn moments(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap_or_default();
    let lines = text.lines().filter(|line| line.starts_with(|first: char| first.is_ascii_digit()));
    let moments = lines.filter(|line| !line.starts_with("7bot"));
    moments
        .map(|line| line.split_whitespace().map(|word| word.parse().expect("a number")).collect())
        .collect()
}

/// Starts to play a recording, and waits until the tool writes the vacuum pump.
pub(super) fn start_to_play(arm: &mut TestArm, arguments: &[&str]) -> RunningProgram {
    arm.spawn_sevenbot_until(&[&["play", "--verbose"], arguments].concat(), "-> write vacuum-pump")
}

#[track_caller]
pub(super) fn wait_for_moments(path: &Path, count: usize) {
    wait_until("the moments are recorded", || moments(path).len() >= count);
}

#[test]
fn a_move_is_recorded_played_and_plotted() {
    with_arm(TestSetup::any(), |arm| {
        let (folder, recording) = file("move.txt", "");
        let drawing = folder.path().join("move.svg");
        arm.wait_until("a recording begins before the end of the move", |arm| {
            arm.drive_to(&STANDARD_POSE);
            // The move of 30 degrees at 5.7 degrees/s takes 5.3 s.
            succeeded(arm.sevenbot(&["pose", "120", "90", "65", "90", "90", "90", "80", "--speed", "3"]));
            let report =
                succeeded(arm.sevenbot(&["record", text(&recording), "--driven", "--yes", "--seconds", "7"]));
            assert!(report.contains("moments in"), "{report}");
            moments(&recording)[0][1] < 115.0
        });
        let moments = moments(&recording);
        let last = &moments[moments.len() - 1];
        assert!((last[1] - 120.0).abs() <= 2.0, "{last:?}");
        assert!(moments.iter().all(|moment| moment.len() == 9));
        assert!(moments.windows(2).all(|pair| pair[0][0] < pair[1][0]));
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0, "reports are off again");

        arm.write(TARGET_POSITION, &STANDARD_POSE);
        arm.wait_for_pose(&STANDARD_POSE);
        let play = ["play", text(&recording), "--speed", "4", "--approach", "2", "--plot", text(&drawing)];
        succeeded(arm.sevenbot(&play));
        assert!(near(arm.positions()[0], 120), "{:?}", arm.positions());
        assert_eq!(arm.read(SPEED, 7), [3; 7], "the speeds are restored");
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0);
        let drawing = fs::read_to_string(drawing).expect("a drawing");
        assert_eq!(drawing.matches("<polyline class=\"measured\"").count(), 8, "seven plots and the legend");
        arm.write(TARGET_POSITION, &STANDARD_POSE);
        arm.wait_for_pose(&STANDARD_POSE);
    });
}

#[test]
fn an_arm_moved_by_hand_holds_its_position_after_the_recording() {
    with_arm(TestSetup::any().supported(), |arm| {
        let (_folder, recording) = file("hand.txt", "");
        let text_of = failed(&arm.sevenbot(&["record", text(&recording)]), 2);
        assert!(
            text_of.contains("the arm falls unless you hold it") && text_of.contains("--yes"),
            "{text_of}"
        );
        assert!(!recording.exists(), "no recording was started");
        let tool = arm.spawn_sevenbot(&["record", text(&recording), "--yes"]);
        wait_for_moments(&recording, 5);
        send_signal(&tool, Signal::INT);
        let output = tool.output();
        let printed = all_output(&output);
        assert_eq!(output.status.code(), Some(0), "Ctrl-C ends a recording: {printed}");
        assert!(printed.contains("the arm holds"), "{printed}");
        arm.reopen(115_200);
        assert_eq!(arm.register(MOTOR_STATE), 1);
        let (targets, positions) = (arm.read(TARGET_POSITION, 7), arm.positions());
        assert!(
            targets.iter().zip(&positions).all(|(target, actual)| near(*target, *actual)),
            "the targets are the positions"
        );
        let again = failed(&arm.sevenbot(&["record", text(&recording), "--driven"]), 2);
        assert!(again.contains("exists. Replace it?"), "{again}");
    });
}

#[test]
fn a_written_recording_is_played_in_a_loop_with_its_pump() {
    with_arm(TestSetup::any(), |arm| {
        let (_folder, recording) = file("wave.txt", WAVE);
        let text = succeeded(arm.sevenbot(&["play", text(&recording), "--loop=2", "--json"]));
        assert!(text.contains("\"times\":2"), "{text}");
        assert_eq!(arm.register(VACUUM_PUMP), 1);
        arm.wait_for_pose(&STANDARD_POSE);
        arm.write(VACUUM_PUMP, &[0]);
    });
}

#[test]
fn a_file_with_an_error_moves_nothing() {
    with_arm(TestSetup::any(), |arm| {
        let refused = |arm: &mut TestArm, lines: &str, options: &[&str]| {
            let (_folder, recording) = file("wrong.txt", lines);
            failed(&arm.sevenbot(&[&["play", text(&recording)], options].concat()), 1)
        };
        let text = refused(arm, "hello\n", &[]);
        assert!(text.contains("wrong.txt") && text.contains("not a recording"), "{text}");
        let text = refused(arm, &format!("{WAVE}1.5 90 90 181 90 90 90 80 0\n"), &[]);
        assert!(text.contains("line 6: joint 3 cannot go to `181`"), "{text}");
        let text = refused(arm, WAVE, &["--speed", "9"]);
        assert!(text.contains("line 4: joint 1 would have to turn at 540 °/s"), "{text}");
        let text = failed(&arm.sevenbot(&["play", "/no/such/file"]), 1);
        assert!(text.contains("/no/such/file"), "{text}");
        let text = failed(&arm.sevenbot(&["play", "x", "--speed", "0"]), 2);
        assert!(text.contains("0.1 to 10"), "{text}");
        assert_eq!(arm.read(TARGET_POSITION, 7), STANDARD_POSE);
        arm.write(MOTOR_STATE, &[2]);
        let text = refused(arm, WAVE, &[]);
        assert!(text.contains("forceless"), "{text}");
        arm.write(MOTOR_STATE, &[1]);
    });
}

#[test]
fn a_movement_that_begins_elsewhere_is_refused_or_approached() {
    with_arm(TestSetup::any(), |arm| {
        let far = "7bot-recording 2\n0 120 90 65 90 90 90 80 0\n0.5 125 90 65 90 90 90 80 0\n";
        let (_folder, recording) = file("far.txt", far);
        arm.drive_to(&STANDARD_POSE);
        let refused = failed(&arm.sevenbot(&["play", text(&recording)]), 1);
        assert!(refused.contains("the first point is far from where the arm stands: joint 1"), "{refused}");
        assert!(refused.contains("from 120.00°") && refused.contains("--approach SECONDS"), "{refused}");
        assert_eq!(arm.read(TARGET_POSITION, 7), STANDARD_POSE);
        let looped = ["play", text(&recording), "--approach", "1", "--loop=2", "--json"];
        assert!(succeeded(arm.sevenbot(&looped)).contains("\"times\":2"));
        assert_eq!((arm.read(TARGET_POSITION, 1), arm.read(SPEED, 7)), (vec![125], vec![60; 7]));
        failed(&arm.sevenbot(&["play", text(&recording), "--approach", "0"]), 2);
        arm.drive_to(&STANDARD_POSE);
    });
}

#[test]
fn an_interrupted_play_holds_the_arm() {
    with_arm(TestSetup::any(), |arm| {
        let (_folder, recording) = file("long.txt", &format!("{WAVE}60 180 90 65 90 90 90 80 0\n"));
        let tool = start_to_play(arm, &[text(&recording)]);
        send_signal(&tool, Signal::INT);
        let text = failed(&tool.output(), 130);
        assert!(text.contains("the arm holds where it is"), "{text}");
        arm.reopen(115_200);
        arm.wait_until_still();
        let (targets, positions) = (arm.read(TARGET_POSITION, 7), arm.positions());
        assert!(targets.iter().zip(&positions).all(|(target, actual)| near(*target, *actual)), "{targets:?}");
        assert!(targets[0] < 180, "before the end of the recording");
        assert_eq!(arm.read(SPEED, 7), [60; 7], "the speeds are restored");
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0);
    });
}

/// Plays a long recording, and kills the program while it streams.
fn kill_while_playing(arm: &mut TestArm) {
    let (_folder, recording) = file("long.txt", &format!("{WAVE}60 180 90 65 90 90 90 80 0\n"));
    let arguments = ["play", "--verbose", text(&recording)];
    let mut tool = arm.spawn_sevenbot_until(&arguments, "-> write fine-target");
    tool.kill();
}

/// First of four registers: set-point period (two bytes), time and action of the watchdog.
const STREAM_REGISTERS: u8 = 184;

#[test]
fn what_a_killed_play_left_is_put_right_by_the_next_move() {
    with_arm(TestSetup::any(), |arm| {
        for pause in [Duration::ZERO, Duration::from_secs(1)] {
            kill_while_playing(arm);
            // The watchdog acts after 0.3 s. A program that starts earlier waits until it has acted.
            sleep(pause);
            let output = arm.sevenbot(&["home"]);
            let said = all_output(&output);
            assert_eq!(output.status.code(), Some(0), "{said}");
            assert!(said.contains("a program ended while it streamed"), "{said}");
            assert_eq!(arm.read(SPEED, 7), [60; 7]);
            assert_eq!((arm.read(STREAM_REGISTERS, 4), arm.register(FEEDBACK_FREQUENCY)), (vec![0; 4], 0));
            arm.drain();
            arm.wait_for_pose(&STANDARD_POSE);
        }
        let said = all_output(&arm.sevenbot(&["home", "--wait"]));
        assert!(!said.contains("ended"), "told once: {said}");
    });
}

#[test]
fn keys_move_the_arm_during_a_recording() {
    with_arm(TestSetup::any(), |arm| {
        let (_folder, recording) = file("taught.txt", "");
        let port = arm.lend_port();
        let arguments = ["record", text(&recording), "--driven", "--port", port.to_str().expect("UTF-8")];
        let mut terminal = Terminal::run(sevenbot(), &arguments);
        terminal.wait_for("moments");
        terminal.keys("2\x1b[1;2C\x1b[Cv");
        terminal.wait_for("pump sucks");
        wait_for_moments(&recording, moments(&recording).len() + 40);
        terminal.keys("q");
        assert!(terminal.wait().success(), "{}", terminal.contents());
        arm.reopen(115_200);
        assert_eq!((arm.read(TARGET_POSITION, 7)[1], arm.register(VACUUM_PUMP)), (101, 1));
        let moments = moments(&recording);
        let last = &moments[moments.len() - 1];
        assert!((last[2] - 101.0).abs() <= 2.0 && last[8] == 1.0, "{last:?}");
        arm.write(VACUUM_PUMP, &[0]);
        arm.write(TARGET_POSITION, &STANDARD_POSE);
        arm.wait_for_pose(&STANDARD_POSE);
    });
}
