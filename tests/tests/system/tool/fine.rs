//! `sevenbot` in hundredths of a degree, and in whole degrees with an arm of the maker.

use std::fs;
use std::process::{Command, Output};

use super::output::{failed, succeeded};
use system_tests::process::start;
use system_tests::programs::{host_sim, tool};
use system_tests::registers::{
    FAULTS, FEEDBACK_FREQUENCY, SPEED, STANDARD_POSE, TARGET_POSITION, VACUUM_PUMP,
};
use system_tests::{TestSetup, with_arm};

/// First of seven fine targets, two bytes each.
const FINE_TARGET: u8 = 128;
/// Set-point period (two bytes), time and action of the watchdog, limits, content of the reports.
const STREAM_REGISTERS: u8 = 184;
/// A recording of version 2: joint 1 moves by 10.25 degrees, and the pump is switched on.
const FINE_WAVE: &str = "\
7bot-recording 2
0.0  90.00 90 65 90 90 90 80  0
0.5 100.25 90 65 90 90 90 80  1
1.0  95.10 90 65 90 90 90 80  1
";

#[test]
fn d21_a_pose_takes_decimals() {
    with_arm(TestSetup::any(), |arm| {
        // At power-up the targets are the measured positions, with their hundredths.
        arm.write(TARGET_POSITION, &STANDARD_POSE);
        let text = succeeded(arm.sevenbot(&["pose", "95.25", "_", "+0.5", "_", "_", "_", "_", "--wait"]));
        assert_eq!([1, 2, 3].map(|joint| arm.counter(FINE_TARGET + 2 * (joint - 1))), [9_525, 9_000, 6_550]);
        let first: f64 = text.split_whitespace().next().expect("degrees").parse().expect("degrees");
        assert!((first - 95.25).abs() < 1.0 && text.contains('.'), "{text}");
        // A relative step begins at the target in hundredths.
        arm.write(STREAM_REGISTERS, &[20, 0]);
        succeeded(arm.sevenbot(&["pose", "-0.3", "_", "_", "_", "_", "_", "_", "--wait"]));
        assert_eq!((arm.counter(FINE_TARGET), arm.counter(STREAM_REGISTERS)), (9_495, 20));
        arm.write(STREAM_REGISTERS, &[0, 0]);
        let text = failed(&arm.sevenbot(&["pose", "+85.1", "_", "_", "_", "_", "_", "_"]), 1);
        assert!(text.contains("joint 1 would go to 180.05°"), "{text}");
        let text = succeeded(arm.sevenbot(&["monitor", "--json", "--samples", "1"]));
        assert!(text.contains("\"fine\":{\"positions\":[") && text.contains("\"load_percent\":["), "{text}");
        let text = succeeded(arm.sevenbot(&["home", "--wait"]));
        assert!(!text.contains('.'), "whole degrees were asked for: {text}");
    });
}

#[test]
fn d23_a_recording_in_hundredths_is_streamed() {
    with_arm(TestSetup::any(), |arm| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("fine.txt");
        fs::write(&file, FINE_WAVE).expect("a file");
        succeeded(arm.sevenbot(&["play", file.to_str().expect("UTF-8")]));
        assert_eq!((arm.counter(FINE_TARGET), arm.register(VACUUM_PUMP)), (9_510, 1));
        assert_eq!((arm.read(SPEED, 7), arm.read(STREAM_REGISTERS, 6)), (vec![60; 7], vec![0; 6]));
        assert_eq!(arm.register(FAULTS) & 1 << 6, 0);
        let recorded = folder.path().join("recorded.txt");
        succeeded(arm.sevenbot(&["record", recorded.to_str().expect("UTF-8"), "--driven", "--seconds", "1"]));
        let text = fs::read_to_string(&recorded).expect("a recording");
        assert!(text.starts_with("7bot-recording 2\n"), "{text}");
        let last = text.lines().last().expect("a moment").split_whitespace().nth(1).expect("joint 1");
        assert!(last.split_once('.').is_some_and(|(_, decimals)| decimals.len() == 2), "{text}");
        assert!((last.parse::<f64>().expect("degrees") - 95.1).abs() < 1.0, "{text}");
        assert_eq!((arm.register(FEEDBACK_FREQUENCY), arm.read(STREAM_REGISTERS, 6)), (0, vec![0; 6]));
        arm.write(VACUUM_PUMP, &[0]);
        arm.write(TARGET_POSITION, &STANDARD_POSE);
        arm.wait_for_pose(&STANDARD_POSE);
    });
}

#[test]
fn d22_d25_two_byte_registers_and_limits_are_told_in_words() {
    with_arm(TestSetup::any(), |arm| {
        let text = succeeded(arm.sevenbot(&["set", "fine-target.1", "9125"]));
        assert!(text.contains("fine-target.1") && text.contains("91.25 °"), "{text}");
        assert_eq!(arm.counter(FINE_TARGET), 9_125);
        let text = failed(&arm.sevenbot(&["set", "129", "5"]), 2);
        assert!(text.contains("fine-target.1 has two bytes"), "{text}");
        let text = failed(&arm.sevenbot(&["set", "--raw", "129", "5"]), 1);
        assert!(text.contains("only one of the two bytes of fine-target.1"), "{text}");
        succeeded(arm.sevenbot(&["set", "limits", "1"]));
        let text = failed(&arm.sevenbot(&["pose", "_", "_", "170.5", "_", "_", "_", "_"]), 1);
        assert!(text.contains("fine-target.3 is against a limit that is switched on"), "{text}");
        succeeded(arm.sevenbot(&["set", "limits", "0"]));
        arm.drive_to(&STANDARD_POSE);
    });
}

/// Starts a simulated arm of the maker. `test` gets a function that runs the tool on it, and one that returns paths in its
/// folder.
fn with_stock_arm(test: impl FnOnce(&dyn Fn(&[&str]) -> Output, &dyn Fn(&str) -> String)) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let mut command = Command::new(host_sim());
    command.args(["--as-maker", "2.1.4", "--eeprom", &path("eeprom.bin"), "--link", &path("7bot")]);
    let _simulator = start(&mut command, 1).expect("a simulator");
    let run = |arguments: &[&str]| {
        tool().args(["--port", &path("7bot")]).args(arguments).output().expect("sevenbot runs")
    };
    test(&run, &path);
}

#[test]
fn an_arm_of_the_maker_takes_the_nearest_whole_degrees() {
    with_stock_arm(|sevenbot, path| {
        let output = sevenbot(&["pose", "95.5", "_", "_", "_", "_", "_", "_", "--wait"]);
        let note = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(note.contains("this arm takes whole degrees"), "{note}");
        assert!(succeeded(output).starts_with("9"), "whole degrees");
        assert!(succeeded(sevenbot(&["get", "target-position.1"])).contains(" 96 "));
        fs::write(path("fine.txt"), FINE_WAVE).expect("a file");
        succeeded(sevenbot(&["play", &path("fine.txt"), "--approach", "1"]));
        assert!(succeeded(sevenbot(&["get", "target-position.1"])).contains(" 95 "));
        succeeded(sevenbot(&["record", &path("r.txt"), "--driven", "--seconds", "1"]));
        let recorded = fs::read_to_string(path("r.txt")).expect("a recording");
        assert!(recorded.starts_with("7bot-recording 1\n"), "{recorded}");
        assert!(!succeeded(sevenbot(&["monitor", "--json", "--samples", "1"])).contains("fine"));
        let refused = failed(&sevenbot(&["get", "fine-position"]), 1);
        assert!(refused.contains("does not have register 142"), "{refused}");
    });
}
