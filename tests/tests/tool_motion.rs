//! `sevenbot record` and `play`: movements to files and back, with the cable in and out.

mod said;

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use said::{done, failed, said};
use system_tests::line::PATIENCE;
use system_tests::own::{OwnArm, World};
use system_tests::programs::{TOOL_TIMEOUT, sevenbot, tool};
use system_tests::registers::{
    FEEDBACK_FREQUENCY, MOTOR_STATE, SPEED, STANDARD_POSE, TARGET_POSITION, VACUUM_PUMP,
};
use system_tests::target::Target;
use system_tests::terminal::Terminal;
use system_tests::{Bench, Need, Setup, near, with_arm};
use tempfile::TempDir;

/// To the left and back, and the pump on.
const WAVE: &str = "\
7bot-recording 1
# by hand
0.0  90 90 65 90 90 90 80  0
0.5 120 80 65 90 90 90 80  1
1.0  90 90 65 90 90 90 80  1
";

/// A folder for a file of this name with this in it.
fn file(name: &str, text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    if !text.is_empty() {
        fs::write(&path, text).expect("a file");
    }
    (folder, path)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// The moments of a recording, field by field.
fn moments(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap_or_default();
    let whole = text.lines().filter(|line| line.starts_with(|first: char| first.is_ascii_digit()));
    let moments = whole.filter(|line| !line.starts_with("7bot"));
    moments
        .map(|line| line.split_whitespace().map(|word| word.parse().expect("a number")).collect())
        .collect()
}

/// The tool in the background, on an arm whose port it borrows.
fn begin(arm: &mut Bench, arguments: &[&str]) -> Child {
    let mut tool = tool();
    tool.arg("--port").arg(arm.lend_port()).args(arguments);
    tool.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("sevenbot runs")
}

/// Plays a long recording in the background, and waits until the arm is under way.
fn begin_to_play(arm: &mut Bench, arguments: &[&str]) -> Child {
    let mut tool = begin(arm, &[&["play", "--verbose"], arguments].concat());
    let mut frames = tool.stderr.take().expect("a pipe");
    let mut came = Vec::new();
    while !String::from_utf8_lossy(&came).contains("-> write vacuum-pump") {
        let mut chunk = [0; 256];
        let length = frames.read(&mut chunk).expect("text");
        assert_ne!(length, 0, "ended before the arm moved:\n{}", String::from_utf8_lossy(&came));
        came.extend(&chunk[..length]);
    }
    tool.stderr = Some(frames);
    tool
}

fn interrupt(tool: &Child) {
    let id = i32::try_from(tool.id()).ok().and_then(Pid::from_raw).expect("a process id");
    kill_process(id, Signal::INT).expect("it is running");
}

#[track_caller]
fn wait_for_moments(path: &Path, count: usize) {
    let deadline = Instant::now() + PATIENCE;
    while moments(path).len() < count {
        assert!(Instant::now() < deadline, "no moments in {}", path.display());
        sleep(Duration::from_millis(10));
    }
}

fn end(tool: Child) -> Output {
    tool.wait_with_output().expect("it ends")
}

#[test]
fn a_move_is_recorded_and_played_and_drawn() {
    with_arm(Setup::any(), |arm| {
        let (folder, tape) = file("move.txt", "");
        let drawing = folder.path().join("move.svg");
        arm.wait_until("a recording begins before the move is over", |arm| {
            arm.drive_to(&STANDARD_POSE);
            // 30 degrees at 5.7 degrees/s.
            done(arm.sevenbot(&["pose", "120", "90", "65", "90", "90", "90", "80", "--speed", "3"]));
            let report = done(arm.sevenbot(&["record", text(&tape), "--driven", "--yes", "--seconds", "7"]));
            assert!(report.contains("moments in"), "{report}");
            moments(&tape)[0][1] < 115.0
        });
        let moments = moments(&tape);
        let last = &moments[moments.len() - 1];
        assert!((last[1] - 120.0).abs() <= 2.0, "{last:?}");
        assert!(moments.iter().all(|moment| moment.len() == 9));
        assert!(moments.windows(2).all(|pair| pair[0][0] < pair[1][0]));
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0, "it reports no more");

        arm.write(TARGET_POSITION, &STANDARD_POSE);
        arm.wait_for_pose(&STANDARD_POSE);
        done(arm.sevenbot(&["play", text(&tape), "--speed", "4", "--plot", text(&drawing)]));
        assert!(near(arm.positions()[0], 120), "{:?}", arm.positions());
        assert_eq!(arm.read(SPEED, 7), [3; 7], "as they were before");
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0);
        let drawing = fs::read_to_string(drawing).expect("a drawing");
        assert_eq!(drawing.matches("<polyline class=\"measured\"").count(), 8, "seven and the legend's");
        arm.write(TARGET_POSITION, &STANDARD_POSE);
        arm.wait_for_pose(&STANDARD_POSE);
    });
}

#[test]
fn a_hand_guides_the_arm_and_the_arm_holds_what_it_was_shown() {
    with_arm(Setup::any().supported(), |arm| {
        let (_folder, tape) = file("hand.txt", "");
        let text_of = failed(&arm.sevenbot(&["record", text(&tape)]), 2);
        assert!(text_of.contains("goes limp") && text_of.contains("--yes"), "{text_of}");
        assert!(!tape.exists(), "nothing was begun");
        let tool = begin(arm, &["record", text(&tape), "--yes"]);
        wait_for_moments(&tape, 5);
        interrupt(&tool);
        let output = end(tool);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(0), "Ctrl-C is how it ends: {said}");
        assert!(said.contains("the arm holds"), "{said}");
        arm.reopen(115_200);
        assert_eq!(arm.register(MOTOR_STATE), 1);
        let (targets, positions) = (arm.read(TARGET_POSITION, 7), arm.positions());
        assert!(
            targets.iter().zip(&positions).all(|(target, is)| near(*target, *is)),
            "it holds where it is"
        );
        let again = failed(&arm.sevenbot(&["record", text(&tape), "--driven"]), 2);
        assert!(again.contains("is there already"), "{again}");
    });
}

#[test]
fn a_movement_written_by_hand_is_played_with_its_pump_again_and_again() {
    with_arm(Setup::any(), |arm| {
        let (_folder, tape) = file("wave.txt", WAVE);
        let text = done(arm.sevenbot(&["play", text(&tape), "--loop=2", "--json"]));
        assert!(text.contains("\"times\":2"), "{text}");
        assert_eq!(arm.register(VACUUM_PUMP), 1);
        arm.wait_for_pose(&STANDARD_POSE);
        arm.write(VACUUM_PUMP, &[0]);
    });
}

#[test]
fn nothing_moves_when_a_file_is_wrong() {
    with_arm(Setup::any(), |arm| {
        let refused = |arm: &mut Bench, lines: &str, options: &[&str]| {
            let (_folder, tape) = file("wrong.txt", lines);
            failed(&arm.sevenbot(&[&["play", text(&tape)], options].concat()), 1)
        };
        let text = refused(arm, "hello\n", &[]);
        assert!(text.contains("wrong.txt") && text.contains("no recording"), "{text}");
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
fn an_interrupted_play_leaves_the_arm_holding() {
    with_arm(Setup::any(), |arm| {
        let (_folder, tape) = file("long.txt", &format!("{WAVE}60 180 90 65 90 90 90 80 0\n"));
        let tool = begin_to_play(arm, &[text(&tape)]);
        interrupt(&tool);
        let text = failed(&end(tool), 130);
        assert!(text.contains("the arm holds where it is"), "{text}");
        arm.reopen(115_200);
        arm.wait_until_still();
        let (targets, positions) = (arm.read(TARGET_POSITION, 7), arm.positions());
        assert!(targets.iter().zip(&positions).all(|(target, is)| near(*target, *is)), "{targets:?}");
        assert!(targets[0] < 180, "not at its end");
        assert_eq!(arm.read(SPEED, 7), [60; 7], "as they were before");
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0);
    });
}

#[test]
fn a_pulled_cable_ends_a_recording_that_is_whole_up_to_there() {
    with_arm(Setup::any().needs(Need::Kill), |arm| {
        let (_folder, tape) = file("cut.txt", "");
        let tool = begin(arm, &["record", text(&tape), "--driven"]);
        wait_for_moments(&tape, 10);
        arm.kill_and_restart();
        let text = failed(&end(tool), 3);
        assert!(text.contains("the connection is gone") && text.contains("is complete up to"), "{text}");
        let moments = moments(&tape);
        assert!(moments.len() >= 10 && moments.iter().all(|moment| moment.len() == 9), "{moments:?}");
        done(arm.sevenbot(&["play", tape.to_str().expect("UTF-8"), "--speed", "5"]));
    });
}

#[test]
fn a_full_disk_ends_a_recording_that_is_whole_up_to_there() {
    with_arm(Setup::any(), |arm| {
        let (_folder, tape) = file("full.txt", "");
        // No file may grow beyond 1 or 2 KiB, as the shell counts; the signal that says so is ignored.
        let limited = "trap '' XFSZ; ulimit -f 2; exec \"$0\" \"$@\"";
        let mut tool = Command::new("sh");
        tool.env(TOOL_TIMEOUT.0, TOOL_TIMEOUT.1)
            .args(["-c", limited])
            .arg(sevenbot())
            .arg("--port")
            .arg(arm.lend_port());
        let output = tool.args(["record", text(&tape), "--driven", "--hz", "50"]).output();
        let said = failed(&output.expect("a shell"), 1);
        assert!(said.contains("is complete up to") && said.contains("full.txt: "), "{said}");
        arm.reopen(115_200);
        assert!(fs::read_to_string(&tape).expect("a file").ends_with('\n'), "no half line");
        done(arm.sevenbot(&["play", text(&tape), "--speed", "10"]));
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0, "it reports no more");
    });
}

#[test]
fn a_pulled_cable_ends_a_play_with_a_drawing_of_what_was() {
    with_arm(Setup::any().needs(Need::Kill), |arm| {
        let (folder, tape) = file("long.txt", &format!("{WAVE}60 180 90 65 90 90 90 80 0\n"));
        let drawing = folder.path().join("cut.svg");
        let tool = begin_to_play(arm, &[text(&tape), "--plot", text(&drawing)]);
        arm.kill_and_restart();
        let said = failed(&end(tool), 3);
        assert!(said.contains("the connection is gone"), "{said}");
        assert!(fs::read_to_string(&drawing).expect("a drawing").ends_with("</svg>\n"));
    });
}

#[test]
fn a_restarted_arm_that_no_longer_reports_is_not_waited_for() {
    // One of its own: whoever has the port open cannot ask for the restart.
    let mut arm = OwnArm::start(World::Simulator, Vec::new());
    let (_folder, tape) = file("restart.txt", "");
    let mut tool = tool();
    tool.arg("--port").arg(arm.port()).args(["record", text(&tape), "--driven"]);
    let tool = tool.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    wait_for_moments(&tape, 3);
    arm.power_cycle();
    let text = failed(&end(tool.expect("sevenbot runs")), 1);
    assert!(text.contains("switched off and on"), "{text}");
}

#[test]
fn keys_teach_a_movement_on_a_terminal() {
    with_arm(Setup::any(), |arm| {
        let (_folder, tape) = file("taught.txt", "");
        let port = arm.lend_port();
        let arguments = ["record", text(&tape), "--driven", "--port", port.to_str().expect("UTF-8")];
        let mut terminal = Terminal::run(sevenbot(), &arguments);
        terminal.wait_for("moments");
        terminal.keys("2\x1b[1;2C\x1b[C ");
        terminal.wait_for("pump sucks");
        wait_for_moments(&tape, moments(&tape).len() + 40);
        terminal.keys("q");
        assert!(terminal.wait().success(), "{}", terminal.shows());
        arm.reopen(115_200);
        assert_eq!((arm.read(TARGET_POSITION, 7)[1], arm.register(VACUUM_PUMP)), (101, 1));
        let moments = moments(&tape);
        let last = &moments[moments.len() - 1];
        assert!((last[2] - 101.0).abs() <= 2.0 && last[8] == 1.0, "{last:?}");
        arm.write(VACUUM_PUMP, &[0]);
        arm.write(TARGET_POSITION, &STANDARD_POSE);
        arm.wait_for_pose(&STANDARD_POSE);
    });
}
