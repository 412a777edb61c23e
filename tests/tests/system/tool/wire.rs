//! The commands for ports, traffic, the register table, completions and manual pages.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use super::output::{failed, run_without_arm, succeeded, words};
use system_tests::frames::reply;
use system_tests::process::RunningProgram;
use system_tests::programs::tool;
use system_tests::registers::{DEVICE_ID, FEEDBACK_FREQUENCY};
use system_tests::simulator::Simulator;
use system_tests::{TestSetup, read_request, with_arm, write_request};

#[test]
fn ports_identifies_arms() {
    with_arm(TestSetup::any().chip_id("0123456789ab"), |arm| {
        arm.write_setting(DEVICE_ID, &[42]);
        let port = arm.lend_port();
        let port = port.to_str().expect("UTF-8");
        let text = succeeded(run_without_arm(&["ports", port, "/dev/null", "/dev/no-such-port"]));
        let found = words(&text, port).join(" ");
        assert!(found.ends_with("7Bot V2, id 42, firmware 3.0, chip 0123456789AB"), "{text}");
        assert!(words(&text, "/dev/null").join(" ").contains("cannot be used"), "{text}");
        assert!(words(&text, "/dev/no-such-port").join(" ").contains("there is no such port"), "{text}");
        let text = succeeded(run_without_arm(&["ports", port, "--json"]));
        assert!(text.contains("\"arm\":{\"device_id\":42,\"firmware\":\"3.0\""), "{text}");
        arm.reopen(115_200);
    });
}

#[test]
fn ports_lists_the_simulators_that_run() {
    let simulator = Simulator::start(&["--arms", "2"]);
    let mut tool = tool();
    tool.arg("ports").env("XDG_RUNTIME_DIR", simulator.folder.path()).env_remove("SEVENBOT_PORT");
    let text = succeeded(tool.output().expect("sevenbot runs"));
    for port in &simulator.ports {
        assert!(words(&text, &port.display().to_string()).join(" ").contains("7Bot V2"), "{text}");
    }
}

#[test]
fn sniff_prints_the_frames_of_a_capture() {
    let positions = [90, 90, 65, 90, 90, 90, 80];
    let mut corrupted = reply(54, &positions);
    corrupted[8] ^= 1;
    let capture = [
        read_request(54, 7),
        reply(54, &positions),
        vec![1, 2, 3],
        write_request(28, &[0, 1]),
        corrupted,
        write_request(250, &[0; 7]),
        read_request(0, 0)[..4].to_vec(),
    ];
    let expected = "\
read present-position 1..7
answer present-position 1..7 = 90 90 65 90 90 90 80 °
3 bytes that are no frame: 01 02 03
write eeprom-lock = 0 (open), motor-state = 1 (servo)
a damaged frame or a part of one, 14 bytes: AA 77 03 36 07 5A 5A 41 5B 5A 5A 50 43 81
7 registers from 250 on, but the last register is 255
a damaged frame or a part of one, 4 bytes: AA 77 03 00
";
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("capture.bin");
    fs::write(&path, capture.concat()).expect("a file");
    let path = path.to_str().expect("UTF-8");
    assert_eq!(succeeded(run_without_arm(&["sniff", path])), expected);
    assert_eq!(through_standard_input(&capture.concat()), expected);
    let json = succeeded(run_without_arm(&["sniff", path, "--json"]));
    assert_eq!(
        json.lines().nth(3),
        Some(
            "{\"seconds\":null,\"kind\":\"write\",\"address\":28,\"count\":2,\"bytes\":[0,1],\
             \"words\":\"write eeprom-lock = 0 (open), motor-state = 1 (servo)\"}"
        )
    );
    assert!(failed(&run_without_arm(&["sniff", "no-such-file"]), 1).contains("no-such-file"));
    assert!(failed(&run_without_arm(&["sniff"]), 2).contains("--port"));
    let ignored = ["--log", "/dev/null/log", "--port", "/dev/null", "servo", "scan"];
    assert!(failed(&run_without_arm(&ignored), 2).contains("opens no arm itself"));
}

fn through_standard_input(bytes: &[u8]) -> String {
    let mut tool = tool();
    tool.args(["sniff", "-"]).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut tool = RunningProgram::spawn(&mut tool);
    tool.stdin.take().expect("a pipe").write_all(bytes).expect("the tool reads");
    succeeded(tool.output())
}

#[test]
fn sniff_prints_the_frames_of_a_port() {
    with_arm(TestSetup::any(), |arm| {
        // A simulated arm ends its reports when the last program closes the port (M12).
        let port = arm.lend_port();
        let mut held = File::options().write(true).open(port).expect("the port opens");
        held.write_all(&write_request(FEEDBACK_FREQUENCY, &[20])).expect("the port takes bytes");
        let mut tool = arm.spawn_sevenbot(&["sniff"]);
        let lines = BufReader::new(tool.stdout.take().expect("a pipe")).lines().map_while(Result::ok);
        let reports = lines.filter(|line| line.contains("  answer present-position 1..7 = 9"));
        assert_eq!(reports.take(3).count(), 3);
        tool.kill();
        arm.reopen(115_200);
        arm.write(FEEDBACK_FREQUENCY, &[0]);
    });
}

#[test]
fn verbose_shows_every_frame() {
    with_arm(TestSetup::any(), |arm| {
        let output = arm.sevenbot(&["get", "motor-state", "--verbose"]);
        let frames = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(frames.contains("-> read motor-state\n"), "{frames}");
        assert!(frames.contains("<- answer motor-state = 1 (servo)\n"), "{frames}");
        assert_eq!(succeeded(output).lines().count(), 1, "frames are not on standard output");
    });
}

#[test]
fn the_register_table_is_printed_in_all_formats() {
    let registers = |form: &str| succeeded(run_without_arm(&["registers", "--format", form]));
    assert_eq!(words(&registers("text"), "46..52")[..2], ["46..52", "TARGET_POSITION"]);
    assert!(registers("markdown").contains("| 46..52 | `TARGET_POSITION` | RAM | RW | 0..180 |"));
    assert!(registers("json").contains("{\"access\":\"RW\",\"address\":46,"), "{}", registers("json"));
    assert_eq!(succeeded(run_without_arm(&["registers", "--json"])), registers("json"));
    assert_accepted_by("cc", &["-std=c99", "-Wall", "-Werror", "-fsyntax-only", "-x", "c"], &registers("c"));
    assert_accepted_by("python3", &["-m", "py_compile"], &registers("python"));
}

/// Checks that a program accepts this text.
fn assert_accepted_by(program: &str, options: &[&str], text: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("registers");
    fs::write(&path, text).expect("a file");
    let output = Command::new(program).args(options).arg(&path).output();
    succeeded(output.unwrap_or_else(|error| panic!("{program} has to be installed for this test: {error}")));
}

#[test]
fn completions_and_manual_pages_are_printed() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = succeeded(run_without_arm(&["completions", shell]));
        assert!(script.contains("sevenbot") && script.contains("restore"), "{shell}");
    }
    assert_accepted_by("bash", &["-n"], &succeeded(run_without_arm(&["completions", "bash"])));
    assert!(succeeded(run_without_arm(&["man"])).contains(".TH sevenbot 1"));
    assert!(succeeded(run_without_arm(&["man", "pose"])).contains(".TH sevenbot-pose 1"));
    assert!(succeeded(run_without_arm(&["man", "servo", "scan"])).contains(".TH sevenbot-servo-scan 1"));
    assert!(failed(&run_without_arm(&["man", "servo", "dance"]), 2).contains("no command dance"));
    let folder = tempfile::tempdir().expect("a folder");
    succeeded(run_without_arm(&["man", "--dir", folder.path().to_str().expect("UTF-8")]));
    for page in ["sevenbot.1", "sevenbot-pose.1", "sevenbot-servo.1", "sevenbot-servo-set-id.1"] {
        assert!(folder.path().join(page).exists(), "{page}");
    }
    assert!(!folder.path().join("sevenbot-servo-help.1").exists());
}
