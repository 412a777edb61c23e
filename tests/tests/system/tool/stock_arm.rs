//! `sevenbot` with an arm as the maker ships it (`host-sim --as-maker 2.1.4`): map 2.1, no status block, no range checks.

use std::fs;
use std::process::{Command, Output};

use super::output::{failed, succeeded};
use system_tests::arm_client::ArmClient;
use system_tests::frames::with_checksum;
use system_tests::process::{RunningProgram, start};
use system_tests::programs::{host_sim, sevenbot, tool};
use system_tests::terminal::Terminal;
use system_tests::{Need, TestSetup, near, with_arm};
use tempfile::TempDir;

/// A simulated arm with the maker's firmware.
struct StockArm {
    _process: RunningProgram,
    folder: TempDir,
}

impl StockArm {
    /// An arm that was switched on for the first time, and obeys.
    fn start() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut command = Command::new(host_sim());
        command.args(["--as-maker", "2.1.4", "--eeprom"]).arg(folder.path().join("eeprom.bin"));
        command.arg("--link").arg(folder.path().join("7bot"));
        let (process, _) = start(&mut command, 1).expect("a simulator");
        Self { _process: process, folder }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    fn sevenbot(&self, arguments: &[&str]) -> Output {
        tool().args(["--port", &self.path("7bot")]).args(arguments).output().expect("sevenbot")
    }
}

/// Checks that the text holds these angles, within the tolerance of [`near`].
fn assert_near(text: &str, pose: [u8; 7]) {
    let angles: Vec<u8> = text.split_whitespace().map(|word| word.parse().expect("an angle")).collect();
    assert_eq!(angles.len(), pose.len(), "{text}");
    assert!(angles.iter().zip(pose).all(|(&angle, wanted)| near(angle, wanted)), "{text}");
}

#[test]
fn the_map_is_found_out_and_told() {
    let arm = StockArm::start();
    let info = arm.sevenbot(&["info"]);
    let text = succeeded(info.clone());
    assert!(text.contains("firmware            2.1"), "{text}");
    assert!(String::from_utf8_lossy(&info.stderr).contains("the maker's firmware 2.1"));
    assert!(succeeded(arm.sevenbot(&["--map", "2.1", "info"])).contains("2.1"));
}

#[test]
fn an_arm_of_this_project_is_the_same_in_both_maps() {
    with_arm(TestSetup::any().needs(Need::FreshArm), |arm| {
        succeeded(arm.sevenbot(&["set", "--unlock", "offset.2", "-5"]));
        succeeded(arm.sevenbot(&["--map", "2.1", "set", "--unlock", "offset.3", "4"]));
        for map in ["2.1", "2.2"] {
            let offsets = succeeded(arm.sevenbot(&["--map", map, "get", "offset", "--json"]));
            assert!(offsets.contains("-5") && offsets.contains('4'), "map {map}: {offsets}");
            succeeded(arm.sevenbot(&["--map", map, "home", "--wait"]));
        }
        let refused = failed(&arm.sevenbot(&["--map", "2.1", "set", "--raw", "speed", "200"]), 1);
        assert!(refused.contains("0 to 100"), "{refused}");
    });
}

#[test]
fn a_pose_is_complete_when_the_positions_rest_at_their_targets() {
    let arm = StockArm::start();
    let pose = ["pose", "150", "100", "60", "90", "90", "90", "40", "--wait"];
    assert_near(&succeeded(arm.sevenbot(&pose)), [150, 100, 60, 90, 90, 90, 40]);
    succeeded(arm.sevenbot(&["stop"]));
    assert_near(&succeeded(arm.sevenbot(&["home", "--wait"])), [90, 90, 65, 90, 90, 90, 80]);
}

#[test]
fn the_monitor_shows_the_joints_without_a_status_block() {
    let arm = StockArm::start();
    let mut terminal = Terminal::run(sevenbot(), &["--port", &arm.path("7bot"), "monitor"]);
    terminal.wait_for("65");
    terminal.keys("q");
    assert!(terminal.wait().success());
}

#[test]
fn a_setting_is_written_only_with_the_lock_open() {
    let arm = StockArm::start();
    let refused = failed(&arm.sevenbot(&["set", "offset.2", "-5"]), 1);
    assert!(refused.contains("EEPROM lock"), "{refused}");
    let written = arm.sevenbot(&["set", "--unlock", "offset.2", "-5"]);
    assert!(succeeded(written.clone()).contains("-5"));
    assert!(String::from_utf8_lossy(&written.stderr).contains("after its next restart"));
    // In map 2.1 an offset is stored as 128 + offset.
    let mut client = ArmClient::open(&arm.folder.path().join("7bot"), 115_200);
    client.send(&[0xAA, 0x77, 3, 13, 7, 0x92, 0xFE]);
    client.expect(&with_checksum(&[0xAA, 0x77, 3, 13, 7, 255, 123, 255, 255, 255, 255, 255]));
}

#[test]
fn settings_are_saved_and_restored() {
    let arm = StockArm::start();
    let file = arm.path("settings.toml");
    succeeded(arm.sevenbot(&["set", "--unlock", "offset", "3"]));
    succeeded(arm.sevenbot(&["backup", &file]));
    assert!(fs::read_to_string(&file).unwrap_or_default().contains("offset = [3, 3, 3, 3, 3, 3, 3]"));
    succeeded(arm.sevenbot(&["calibrate", "--reset", "--yes"]));
    assert!(!succeeded(arm.sevenbot(&["get", "offset"])).contains(" 3 "));
    succeeded(arm.sevenbot(&["restore", &file, "--yes"]));
    let offsets = succeeded(arm.sevenbot(&["get", "offset.1"]));
    assert!(offsets.contains(" 3 "), "{offsets}");
}

/// Options are this project's addition (M6), and any write to a position moves an arm of the maker.
#[test]
fn registers_that_this_arm_lacks_are_told() {
    let arm = StockArm::start();
    let missing = "the arm's firmware 2.1 does not have register 20, options";
    for command in [["get", "options", "--json"].as_slice(), &["set", "--unlock", "options", "0"]] {
        let error = failed(&arm.sevenbot(command), 1);
        assert!(error.contains(missing), "{error}");
    }
    let file = arm.path("settings.toml");
    succeeded(arm.sevenbot(&["backup", &file]));
    let text = fs::read_to_string(&file).unwrap_or_default();
    assert!(text.contains("offset = ") && !text.contains("options"), "{text}");
    fs::write(&file, text.replace("device-id = 255", "device-id = 9") + "options = 2\n").expect("a file");
    let restored = arm.sevenbot(&["restore", &file, "--yes"]);
    let warning = String::from_utf8_lossy(&restored.stderr).into_owned();
    assert!(warning.contains("has no options: this setting is not written"), "{warning}");
    assert!(succeeded(restored).contains("255  ->  9"));
    assert!(succeeded(arm.sevenbot(&["get", "device-id"])).contains(" 9"));
    succeeded(arm.sevenbot(&["set", "button-enable", "0"]));
    let refused = failed(&arm.sevenbot(&["set", "wrist-position.1", "4"]), 2);
    assert!(refused.contains("wrist-position has no joints"), "{refused}");
    let refused = failed(&arm.sevenbot(&["set", "wrist-position", "4", "100", "4", "200", "4", "150"]), 1);
    assert!(refused.contains("any write there moves an arm of the maker"), "{refused}");
    assert!(succeeded(arm.sevenbot(&["get", "target-position.1"])).contains("90"));
}

#[test]
fn a_movement_is_recorded_by_hand_and_played() {
    let arm = StockArm::start();
    let file = arm.path("wave.txt");
    succeeded(arm.sevenbot(&["pose", "90", "50", "65", "90", "90", "90", "80", "--wait"]));
    succeeded(arm.sevenbot(&["record", "--yes", "--seconds", "1", &file]));
    let moments = fs::read_to_string(&file).unwrap_or_default();
    // The arm sends a report each 34 ms.
    assert!(moments.lines().any(|line| line.starts_with("0.034 ")), "{moments}");
    // The arm fell while it was limp. It holds where it fell, and does not go back to its target.
    let degrees = |name| {
        let line = succeeded(arm.sevenbot(&["get", name]));
        line.split_whitespace().nth(2).and_then(|word| word.parse::<u8>().ok()).expect("an angle")
    };
    let (target, present) = (degrees("target-position.2"), degrees("present-position.2"));
    assert!(target < 45 && target.abs_diff(present) <= 1, "target {target}, present {present}");
    fs::write(&file, "7bot-recording 1\n0.0 90 90 65 90 90 90 80 0\n0.5 110 90 65 90 90 90 80 1\n")
        .expect("a file");
    succeeded(arm.sevenbot(&["play", &file, "--approach", "2"]));
    assert!(succeeded(arm.sevenbot(&["get", "vacuum-pump"])).contains("suck"));
}

#[test]
fn a_rate_that_the_maker_does_not_know_is_refused() {
    let arm = StockArm::start();
    let refused = failed(&arm.sevenbot(&["baud", "9600"]), 2);
    assert!(refused.contains("115200 and 1000000"), "{refused}");
    succeeded(arm.sevenbot(&["baud", "1000000"]));
}
