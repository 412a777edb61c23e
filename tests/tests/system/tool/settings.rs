//! The commands for settings and for the end effector.

use std::fs;

use super::output::{failed, run_without_arm, succeeded, words};
use system_tests::registers::{BAUD_RATE, DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, OFFSET, VACUUM_PUMP};
use system_tests::simulator::Simulator;
use system_tests::wait::wait_for;
use system_tests::{Need, TestSetup, with_arm};

#[test]
fn settings_are_saved_to_a_file_and_restored() {
    with_arm(TestSetup::any(), |arm| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("arm.toml");
        let file = path.to_str().expect("UTF-8");
        arm.write_setting(DEVICE_ID, &[42, 3, 0, 0x85, 0, 0, 0, 0, 16]);
        succeeded(arm.sevenbot(&["backup", file]));
        let text = fs::read_to_string(&path).expect("a file");
        assert!(text.contains("device-id = 42\n") && text.contains("baud-rate = 1000000\n"), "{text}");
        assert!(text.contains("offset = [0, -5, 0, 0, 0, 0, 16]\n"), "{text}");
        let again = failed(&arm.sevenbot(&["backup", file]), 1);
        assert!(again.contains("the file exists") && again.contains("--force"), "{again}");
        assert_eq!(succeeded(arm.sevenbot(&["backup", "-"])), text);
        let json = succeeded(arm.sevenbot(&["backup", "-", "--json"]));
        assert!(json.contains("\"settings\":{") && json.contains("\"device-id\":42"), "{json}");

        arm.write_setting(DEVICE_ID, &[0, 0, 0, 0, 0, 0, 0, 0, 16]);
        let prompt = failed(&arm.sevenbot(&["restore", file]), 2);
        assert_eq!(words(&prompt, "device-id"), ["device-id", "0", "->", "42"]);
        assert_eq!(words(&prompt, "offset.2"), ["offset.2", "0", "°", "->", "-5", "°"]);
        assert!(!prompt.contains("offset.7"), "it does not change: {prompt}");
        assert_eq!(arm.register(DEVICE_ID), 0, "without a confirmation");
        succeeded(arm.sevenbot(&["restore", "--yes", file]));
        assert_eq!(arm.read(DEVICE_ID, 9), [42, 3, 0, 0x85, 0, 0, 0, 0, 16]);
        assert_eq!(arm.register(EEPROM_LOCK), 1, "closed again");
        let same = succeeded(arm.sevenbot(&["restore", file]));
        assert!(same.contains("has these settings already"), "{same}");
        succeeded(arm.sevenbot(&["backup", "--force", file]));
        assert_eq!(fs::read_to_string(&path).expect("a file"), text);
    });
}

#[test]
fn a_file_with_an_error_changes_nothing() {
    with_arm(TestSetup::any(), |arm| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("arm.toml");
        let file = path.to_str().expect("UTF-8").to_owned();
        let head = "format = 1\nchip-id = \"\"\nfirmware = \"3.0\"\n[settings]\n";
        for (text, expected) in [
            (format!("{head}device-id = 9\noffset = [0, 0, 17, 0, 0, 0, 0]\n"), "offset.3 takes -16 to 16"),
            (format!("{head}device-id = 9\nspeed = 3\n"), "speed is not a setting"),
            (head.replace("format = 1", "format = 2"), "this program reads format 1"),
            (format!("{head}device-id = \n"), "arm.toml"),
        ] {
            fs::write(&path, text).expect("a file");
            let error = failed(&arm.sevenbot(&["restore", "--yes", &file]), 1);
            assert!(error.contains(expected), "{error}");
        }
        assert_eq!(arm.register(DEVICE_ID), 0);
        // A file of another arm is restored only on request.
        fs::write(&path, format!("{head}device-id = 9\n")).expect("a file");
        let refused = failed(&arm.sevenbot(&["restore", "--yes", &file]), 2);
        assert!(refused.contains("this arm has chip") && refused.contains("--other-arm"), "{refused}");
        assert_eq!(arm.register(DEVICE_ID), 0);
        succeeded(arm.sevenbot(&["restore", "--yes", "--other-arm", &file]));
        assert_eq!(arm.register(DEVICE_ID), 9);
        let error = failed(&arm.sevenbot(&["restore", "--yes", "no-such-file"]), 1);
        assert!(error.contains("no-such-file"), "{error}");
    });
}

/// With `--strict-baud` the simulator ignores frames at other baud rates, so that the search for a lost rate can be tried.
#[test]
fn a_lost_baud_rate_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = folder.path().join("arm.bin");
    let simulator = Simulator::start(&["--strict-baud", "--eeprom", settings.to_str().expect("text")]);
    let port = simulator.ports[0].to_str().expect("text");
    let run = |arguments: &[&str]| run_without_arm(&[&["--port", port], arguments].concat());
    succeeded(run(&["baud", "57600"]));
    simulator.says(&["power", "cycle"]);
    let lost = failed(&run(&["--timeout", "100", "info"]), 3);
    assert!(lost.contains("baud --find"), "{lost}");
    let found = wait_for("the rate is found", || {
        let output = run(&["baud", "--find"]);
        // At each rate the tool asks twice, and waits 0.2 s for each answer, which is short on a busy machine.
        if output.status.success() { Ok(succeeded(output)) } else { Err(failed(&output, 3)) }
    });
    assert!(found.contains("now            57600 baud"), "{found}");
    succeeded(run(&["--baud", "57600", "info"]));
}

#[test]
fn baud_changes_the_rate_and_explains_the_restart() {
    with_arm(TestSetup::any().needs(Need::Persistence).needs(Need::PowerCycle), |arm| {
        let text = failed(&arm.sevenbot(&["baud", "12345"]), 2);
        assert!(text.contains("9600, 19200, 38400") && text.contains("1000000"), "{text}");
        let output = arm.sevenbot(&["baud", "57600"]);
        assert!(String::from_utf8_lossy(&output.stderr).contains("off and on"), "{output:?}");
        let text = succeeded(output);
        assert_eq!(words(&text, "now"), ["now", "115200", "baud"]);
        assert_eq!(words(&text, "after restart"), ["after", "restart", "57600", "baud"]);
        assert_eq!((arm.register(BAUD_RATE), arm.register(EEPROM_LOCK)), (4, 1));
        arm.power_cycle(57_600);
        let text = succeeded(arm.sevenbot(&["--baud", "57600", "baud", "--json"]));
        assert_eq!(text, "{\"baud\":57600,\"baud_after_restart\":57600}\n");
        assert!(succeeded(arm.sevenbot(&["baud", "--find"])).contains("after restart  57600 baud"));
    });
    assert!(failed(&run_without_arm(&["baud", "--find"]), 2).contains("--find needs --port"));
}

#[test]
fn the_pump_and_the_effector_are_switched_and_shown() {
    with_arm(TestSetup::any(), |arm| {
        assert_eq!(words(&succeeded(arm.sevenbot(&["vacuum"])), "31")[2..], ["0", "release"]);
        succeeded(arm.sevenbot(&["vacuum", "on"]));
        assert_eq!(arm.register(VACUUM_PUMP), 1);
        succeeded(arm.sevenbot(&["vacuum", "off"]));
        assert_eq!(arm.register(VACUUM_PUMP), 0);
        let text = succeeded(arm.sevenbot(&["effector", "gripper"]));
        assert_eq!(words(&text, "30")[2..], ["1", "gripper"]);
        assert_eq!(arm.register(EFFECTOR_TYPE), 1);
        succeeded(arm.sevenbot(&["effector", "suction-cup"]));
        assert_eq!(arm.register(EFFECTOR_TYPE), 0);
    });
}

#[test]
fn values_are_printed_as_json() {
    with_arm(TestSetup::any().chip_id("0123456789ab"), |arm| {
        arm.write_setting(OFFSET, &[0, 0x85]);
        let text = succeeded(arm.sevenbot(&["get", "offset.2", "chip-id", "--json"]));
        assert_eq!(
            text,
            "{\"registers\":[\
             {\"address\":14,\"name\":\"offset.2\",\"bytes\":[133],\"value\":-5,\"meaning\":\"°\"},\
             {\"address\":2,\"name\":\"chip-id\",\"bytes\":[1,35,69,103,137,171],\"value\":\"0123456789AB\",\
             \"meaning\":\"\"}]}\n"
        );
        let text = succeeded(arm.sevenbot(&["info", "--json"]));
        for part in ["\"firmware\":\"3.0\"", "\"healthy\":true", "\"missing_joints\":[]", "[0,-5,0,0,0,0,0]"]
        {
            assert!(text.contains(part), "{part} in {text}");
        }
        assert_eq!(text.lines().count(), 1);
    });
}
