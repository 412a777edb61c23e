//! `sevenbot record`, `play` and other commands with files, when a file cannot be written, the connection is lost or the arm
//! restarts.

use std::fs;
use std::process::{Command, Stdio};

use super::motion::{WAVE, file, moments, start_to_play, text, wait_for_moments};
use super::output::{failed, succeeded};
use system_tests::arm_control::ArmControl;
use system_tests::process::RunningProgram;
use system_tests::programs::{TOOL_TIMEOUT, sevenbot, tool};
use system_tests::registers::{FEEDBACK_FREQUENCY, STANDARD_POSE, TARGET_POSITION, VACUUM_PUMP};
use system_tests::started_arm::{ArmKind, StartedArm};
use system_tests::{Need, TestArm, TestSetup, with_arm};

#[test]
fn a_file_that_cannot_be_written_is_refused_before_anything_moves() {
    with_arm(TestSetup::any(), |arm| {
        let (folder, recording) = file("wave.txt", WAVE);
        let drawing = folder.path().join("wave.svg");
        fs::write(&drawing, "years").expect("a file");
        let refused = |arm: &mut TestArm, arguments: &[&str], says: &str| {
            let said = failed(&arm.sevenbot(arguments), 1);
            assert!(said.contains(says), "{said}");
        };
        let play = ["play", text(&recording), "--plot"];
        arm.write(VACUUM_PUMP, &[0]);
        refused(arm, &[&play[..], &["/dev/null/wave.svg"]].concat(), "/dev/null/wave.svg");
        refused(arm, &[&play[..], &[text(&drawing)]].concat(), "the file exists; --force replaces it");
        refused(arm, &[&play[..], &[text(&recording), "--force"]].concat(), "the file that is read");
        let plot = ["plot", text(&recording), "--out"];
        refused(arm, &[&plot[..], &[text(&recording), "--force"]].concat(), "the file that is read");
        refused(arm, &[&plot[..], &[text(&drawing)]].concat(), "the file exists");
        refused(arm, &["monitor", "--samples", "1", "--csv", text(&drawing)], "the file exists");
        refused(arm, &["play", "/dev/zero"], "not a recording");
        refused(arm, &["restore", "/dev/zero"], "is it the right file?");
        assert_eq!(fs::read_to_string(&drawing).expect("a file"), "years");
        assert_eq!(fs::read_to_string(&recording).expect("a file"), WAVE);
        assert_eq!((arm.read(TARGET_POSITION, 7), arm.register(VACUUM_PUMP)), (STANDARD_POSE.to_vec(), 0));
        let said = failed(&arm.sevenbot(&["record", "-", "--driven"]), 2);
        assert!(said.contains("- is no name of a file"), "{said}");
        let said = failed(&arm.sevenbot(&["play", text(&recording), "--loop=0"]), 2);
        assert!(said.contains("1 or more"), "{said}");
        succeeded(arm.sevenbot(&[&plot[..], &[text(&drawing), "--force"]].concat()));
        assert!(fs::read_to_string(&drawing).expect("a file").ends_with("</svg>\n"));
    });
}

#[test]
fn a_recording_is_complete_up_to_a_lost_connection() {
    with_arm(TestSetup::any().needs(Need::Kill), |arm| {
        let (_folder, recording) = file("cut.txt", "");
        let tool = arm.spawn_sevenbot(&["record", text(&recording), "--driven"]);
        wait_for_moments(&recording, 10);
        arm.kill_and_restart();
        let text = failed(&tool.output(), 3);
        assert!(text.contains("the connection is gone") && text.contains("is complete up to"), "{text}");
        let moments = moments(&recording);
        assert!(moments.len() >= 10 && moments.iter().all(|moment| moment.len() == 9), "{moments:?}");
        succeeded(arm.sevenbot(&["play", recording.to_str().expect("UTF-8"), "--speed", "5"]));
    });
}

#[test]
fn a_recording_is_complete_up_to_a_full_disk() {
    with_arm(TestSetup::any(), |arm| {
        let (_folder, recording) = file("full.txt", "");
        // Limits files to 1 or 2 KiB, depending on the shell, and ignores the signal at the limit.
        let limited = "trap '' XFSZ; ulimit -f 2; exec \"$0\" \"$@\"";
        let mut tool = Command::new("sh");
        tool.env(TOOL_TIMEOUT.0, TOOL_TIMEOUT.1)
            .args(["-c", limited])
            .arg(sevenbot())
            .arg("--port")
            .arg(arm.lend_port());
        let output = tool.args(["record", text(&recording), "--driven", "--hz", "50"]).output();
        let error = failed(&output.expect("a shell"), 1);
        assert!(error.contains("is complete up to") && error.contains("full.txt: "), "{error}");
        arm.reopen(115_200);
        assert!(fs::read_to_string(&recording).expect("a file").ends_with('\n'), "a complete last line");
        succeeded(arm.sevenbot(&["play", text(&recording), "--speed", "10"]));
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 0, "reports are off again");
    });
}

#[test]
fn a_file_keeps_its_content_until_there_is_new_content() {
    with_arm(TestSetup::any().fault("3=missing"), |arm| {
        let (folder, old) = file("old.txt", WAVE);
        let new = folder.path().join("new.txt");
        let [old, new] = [&old, &new].map(|path| text(path));
        let recorded = arm.sevenbot(&["record", old, "--mcap", new, "--driven", "--yes", "--seconds", "1"]);
        assert!(failed(&recorded, 1).contains("nothing was recorded, and no file has changed"));
        assert_eq!(fs::read_to_string(old).expect("a file"), WAVE);
        assert!(fs::read(new).is_err(), "a file without content");
        // No file can grow in this shell.
        let no_room = "trap '' XFSZ; ulimit -f 0; exec \"$0\" \"$@\"";
        for output in [old, new] {
            let mut tool = Command::new("sh");
            tool.args(["-c", no_room])
                .arg(sevenbot())
                .args(["convert", "--force", "--to", "csv", "-", output]);
            let recording = fs::File::open(old).expect("a file");
            failed(&tool.stdin(recording).output().expect("a shell"), 1);
        }
        assert_eq!(fs::read_to_string(old).expect("a file"), WAVE);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1, "a file without content");
    });
}

#[test]
fn a_lost_connection_during_play_leaves_a_plot() {
    with_arm(TestSetup::any().needs(Need::Kill), |arm| {
        let (folder, recording) = file("long.txt", &format!("{WAVE}60 180 90 65 90 90 90 80 0\n"));
        let drawing = folder.path().join("cut.svg");
        let tool = start_to_play(arm, &[text(&recording), "--plot", text(&drawing)]);
        arm.kill_and_restart();
        let text = failed(&tool.output(), 3);
        assert!(text.contains("the connection is gone"), "{text}");
        assert!(fs::read_to_string(&drawing).expect("a drawing").ends_with("</svg>\n"));
    });
}

#[test]
fn a_restart_of_the_arm_ends_a_recording() {
    // The arm is restarted while the tool has its port open.
    let mut arm = StartedArm::start(ArmKind::Simulator, Vec::new());
    let (_folder, recording) = file("restart.txt", "");
    let mut tool = tool();
    tool.arg("--port").arg(arm.port()).args(["record", text(&recording), "--driven"]);
    tool.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let tool = RunningProgram::spawn(&mut tool);
    wait_for_moments(&recording, 3);
    arm.power_cycle();
    let text = failed(&tool.output(), 1);
    // The tool detects a restart by the counter of frames. If the arm had received only a few frames, the tool notices
    // missing reports instead.
    assert!(text.contains("the controller restarted") || text.contains("switched off and on"), "{text}");
}
