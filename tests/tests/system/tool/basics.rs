//! The command line tool: arguments in, text and exit status out.

use std::io::Read;

use super::output::{all_output, failed, run_without_arm, stored, succeeded, words};
use system_tests::registers::{
    DEVICE_ID, EEPROM_LOCK, EFFECTOR_TYPE, FEEDBACK_FREQUENCY, MOTOR_STATE, OFFSET, SPEED, STANDARD_POSE,
    TARGET_POSITION, TIME,
};
use system_tests::{Need, TestSetup, near, with_arm};

#[test]
fn info_shows_identity_and_status() {
    with_arm(TestSetup::any().chip_id("0123456789ab"), |arm| {
        arm.write_setting(OFFSET, &[0, 0x85]);
        let text = succeeded(arm.sevenbot(&["info"]));
        assert_eq!(words(&text, "firmware"), ["firmware", "3.0"]);
        assert_eq!(words(&text, "chip id"), ["chip", "id", "0123456789AB"]);
        assert_eq!(words(&text, "offsets"), ["offsets", "0", "-5", "0", "0", "0", "0", "0", "°"]);
        assert_eq!(words(&text, "motor state"), ["motor", "state", "servo"]);
        assert_eq!(words(&text, "faults"), ["faults", "none"]);
        assert!(!text.contains('\x1b'), "no colours in a pipe");
    });
}

#[test]
fn info_has_exit_status_1_if_a_servo_is_missing() {
    with_arm(TestSetup::any().fault("3=missing"), |arm| {
        arm.wait_until("the missing servo is reported", |arm| arm.register(242) == 0b100);
        let text = failed(&arm.sevenbot(&["info"]), 1);
        assert_eq!(words(&text, "servos missing"), ["servos", "missing", "joint", "3"]);
        assert!(text.contains("error:") && text.contains("servo bus"), "{text}");
    });
}

#[test]
fn get_shows_registers_by_name_number_and_range() {
    with_arm(TestSetup::any(), |arm| {
        arm.write(SPEED, &[1, 2, 3, 4, 5, 6, 7]);
        let text = succeeded(arm.sevenbot(&["get", "SPEED.3", "motor_state", "12", "32..33", "chip-id"]));
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(lines[0], ["34", "speed.3", "3", "5.7", "°/s"]);
        assert_eq!(lines[1], ["29", "motor-state", "1", "servo"]);
        assert_eq!(lines[2], ["12", "baud-rate", "0", "115200", "baud"]);
        assert_eq!(lines[3][..3], ["32", "speed.1", "1"]);
        assert_eq!(lines[4][..3], ["33", "speed.2", "2"]);
        assert_eq!(lines[5][..2], ["2", "chip-id"]);
        assert_eq!(lines.len(), 6);
        let raw = succeeded(arm.sevenbot(&["get", "--raw", "28..29"]));
        assert_eq!(words(&raw, "28"), ["28", "eeprom-lock", "0x01"]);
        let all = succeeded(arm.sevenbot(&["get", "0..255", "--raw"]));
        assert_eq!((all.lines().count(), words(&all, "255")[0]), (256, "255"));
        let status = succeeded(arm.sevenbot(&["get", "status-version..255"]));
        assert_eq!(words(&status, "240")[1], "status-version");
    });
}

#[test]
fn set_writes_reads_back_and_prints() {
    with_arm(TestSetup::any(), |arm| {
        let text = succeeded(arm.sevenbot(&["set", "speed", "30"]));
        assert_eq!(text.lines().count(), 7);
        assert_eq!(arm.read(SPEED, 7), [30; 7]);
        succeeded(arm.sevenbot(&["set", "speed.2", "0x11", "--raw"]));
        assert_eq!(arm.read(SPEED, 3), [30, 17, 30]);
        succeeded(arm.sevenbot(&["set", "30..31", "1", "0"]));
        assert_eq!(arm.read(EFFECTOR_TYPE, 2), [1, 0]);
    });
}

#[test]
fn set_reports_the_lock_and_opens_it_on_request() {
    with_arm(TestSetup::any(), |arm| {
        let text = failed(&arm.sevenbot(&["set", "offset.2", "-5"]), 1);
        assert!(text.contains("EEPROM lock") && text.contains("--unlock"), "{text}");
        assert_eq!(arm.register(OFFSET + 1), 0);
        let text = stored(arm, &["set", "--unlock", "offset.2", "-5"]);
        assert_eq!(words(&text, "14"), ["14", "offset.2", "-5", "°"]);
        assert_eq!(arm.register(OFFSET + 1), 0x85);
        assert_eq!(arm.register(EEPROM_LOCK), 1, "closed again");
    });
}

#[test]
fn set_reports_values_out_of_range() {
    with_arm(TestSetup::any(), |arm| {
        let before = arm.read(TARGET_POSITION, 7);
        let text = failed(&arm.sevenbot(&["set", "target-position.3", "181"]), 2);
        assert!(text.contains("target-position.3 takes 0 to 180"), "{text}");
        let pose = ["set", "target", "--raw", "10", "20", "30", "40", "50", "60", "200"];
        let text = failed(&arm.sevenbot(&pose), 1);
        assert!(text.contains("target-position.7 takes 0 to 180"), "{text}");
        assert_eq!(text.matches("error:").count(), 1, "one error for all seven: {text}");
        assert_eq!(arm.read(TARGET_POSITION, 7), before);
    });
}

#[test]
fn set_asks_before_the_arm_falls() {
    with_arm(TestSetup::any().supported(), |arm| {
        for register in ["motor-state", "28..29"] {
            let values: &[&str] = if register == "motor-state" { &["2"] } else { &["1", "0"] };
            let text = failed(&arm.sevenbot(&[&["set", register], values].concat()), 2);
            assert!(text.contains("unless you hold it") && text.contains("--yes"), "{text}");
            assert_eq!(arm.register(MOTOR_STATE), 1);
        }
        succeeded(arm.sevenbot(&["set", "motor-state", "2", "--yes"]));
        assert_eq!(arm.register(MOTOR_STATE), 2);
        succeeded(arm.sevenbot(&["set", "motor-state", "0"]));
        succeeded(arm.sevenbot(&["set", "motor-state", "1"]));
    });
}

#[test]
fn errors_with_json_are_json() {
    let output = run_without_arm(&["--json", "--port", "/dev/no-such-port", "info"]);
    assert_eq!(output.status.code(), Some(3));
    let line = String::from_utf8(output.stderr).expect("text");
    let error: serde_json::Value = serde_json::from_str(&line).expect(&line);
    assert!(error["error"].as_str().is_some_and(|text| text.contains("no such port")), "{line}");
    assert!(error["advice"][0].is_string() && error["status"] == 3, "{line}");
}

#[test]
fn set_reports_read_only_and_unknown_registers() {
    with_arm(TestSetup::any(), |arm| {
        let text = failed(&arm.sevenbot(&["set", "present-position.1", "10"]), 1);
        assert!(text.contains("read only"), "{text}");
        let text = failed(&arm.sevenbot(&["set", "100", "10"]), 1);
        assert!(text.contains("no register"), "{text}");
    });
}

#[test]
fn set_reports_a_full_storage() {
    with_arm(TestSetup::any().needs(Need::ExpendableStorage), |arm| {
        arm.write(EEPROM_LOCK, &[0]);
        let mut id = 0_u8;
        while arm.register(DEVICE_ID) == id {
            id = id.wrapping_add(1);
            arm.write(DEVICE_ID, &[id]);
        }
        let text = failed(&arm.sevenbot(&["set", "--unlock", "device-id", "7"]), 1);
        assert!(text.contains("storage is full"), "{text}");
    });
}

#[test]
fn pose_moves_the_arm_and_waits() {
    with_arm(TestSetup::any(), |arm| {
        let text = succeeded(
            arm.sevenbot(&["pose", "--wait", "--speed", "100", "120", "90", "65", "90", "90", "90", "80"]),
        );
        let positions: Vec<u8> = text.split_whitespace().map(|word| word.parse().expect("degrees")).collect();
        assert!(near(positions[0], 120), "{positions:?}");
        assert_eq!(arm.read(SPEED, 7), [60; 7], "put back after the move");
        arm.wait_for_pose(&[120, 90, 65, 90, 90, 90, 80]);
        succeeded(arm.sevenbot(&["pose", "--wait", "--time", "5", "90", "90", "65", "90", "90", "90", "80"]));
        assert_eq!((arm.read(SPEED, 7), arm.read(TIME, 7)), (vec![60; 7], vec![0; 7]));
        arm.wait_for_pose(&STANDARD_POSE);
        succeeded(arm.sevenbot(&["home", "--time", "0.5s"]));
        assert_eq!(
            arm.read(SPEED, 7),
            [0; 7],
            "speed 0, so that the time applies; the program ends before the move"
        );
        assert_eq!(arm.read(TIME, 7), [5; 7]);
    });
}

#[test]
fn pose_reports_why_the_arm_does_not_reach_the_pose() {
    with_arm(TestSetup::any(), |arm| {
        arm.write(MOTOR_STATE, &[2]);
        let text = failed(&arm.sevenbot(&["pose", "90", "90", "65", "90", "90", "90", "80"]), 1);
        assert!(text.contains("forceless"), "{text}");
    });
    with_arm(TestSetup::any().fault("3=stuck"), |arm| {
        arm.wait_for_pose(&STANDARD_POSE);
        let text = failed(&arm.sevenbot(&["pose", "--wait", "90", "90", "100", "90", "90", "90", "80"]), 1);
        assert!(text.contains("joint 3 is blocked"), "{text}");
    });
}

#[test]
fn monitor_prints_a_line_per_sample_into_a_pipe() {
    with_arm(TestSetup::any(), |arm| {
        // Reports between the replies must have no effect.
        arm.write(FEEDBACK_FREQUENCY, &[50]);
        let text = succeeded(arm.sevenbot(&["monitor", "--samples", "5", "--hz", "50"]));
        arm.write(FEEDBACK_FREQUENCY, &[0]);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(lines.len(), 6, "{text}");
        assert_eq!((lines[0][0], lines[0][1], lines[0][8]), ("seconds", "target.1", "present.1"));
        for line in &lines[1..] {
            assert_eq!(line.len(), 16, "{text}");
            let degrees = line[1..15].iter().map(|word| word.parse::<u8>().expect("degrees"));
            assert!(
                degrees
                    .zip([STANDARD_POSE, STANDARD_POSE].concat())
                    .all(|(actual, expected)| near(actual, expected))
            );
            assert_eq!(line[15], "-", "no joint moves");
        }
    });
}

#[test]
fn monitor_ends_without_an_error_when_its_pipe_closes() {
    with_arm(TestSetup::any(), |arm| {
        let mut monitor = arm.spawn_sevenbot(&["monitor", "--hz", "50"]);
        let mut output = monitor.stdout.take().expect("a pipe");
        output.read_exact(&mut [0; 20]).expect("the first line");
        drop(output);
        let output = monitor.output();
        // The emulator has no flash that keeps settings.
        let said = all_output(&output);
        assert!(
            ["", "warning: settings cannot be stored, or could not be read\n"].contains(&&*said),
            "{said}"
        );
        assert_eq!(output.status.code(), Some(0));
        arm.reopen(115_200);
    });
}

#[test]
fn without_a_connection_the_tool_suggests_what_to_check() {
    let run = run_without_arm;
    let text = failed(&run(&["info"]), 3);
    assert!(text.contains("--port") && text.contains("SEVENBOT_PORT"), "{text}");
    let text = failed(&run(&["--port", "/dev/no-such-port", "info"]), 3);
    assert!(text.contains("/dev/no-such-port: there is no such port"), "{text}");
    let text = failed(&run(&["get", "nonsense"]), 2);
    assert!(text.contains("no register of this name"), "{text}");
    with_arm(TestSetup::any(), |arm| {
        let port = arm.lend_port();
        let holder = system_tests::ArmClient::open(&port, 115_200);
        let port = port.to_str().expect("UTF-8");
        let text = failed(&run(&["--port", port, "info"]), 3);
        assert!(text.contains("another program has this port open"), "{text}");
        let text = failed(&run(&["--port", port, "stop", "--all"]), 3);
        assert!(text.contains(&format!("{port}: the arm received no stop and may be moving")), "{text}");
        assert!(!text.contains("no serial port"), "{text}");
        drop(holder);
        arm.reopen(115_200);
    });
}

#[test]
fn help_contains_examples_and_exit_statuses() {
    let help = |arguments: &[&str]| succeeded(run_without_arm(arguments));
    let text = help(&["--help"]);
    assert!(text.contains("Examples:") && text.contains("Exit status:"), "{text}");
    for command in ["get", "set", "pose", "monitor"] {
        assert!(help(&[command, "--help"]).contains("Examples:"), "{command}");
    }
}

#[test]
fn commands_that_need_a_port_of_this_computer_refuse_a_server() {
    for command in [&["serve"][..], &["view", "--no-open"], &["sniff"]] {
        let refused = run_without_arm(&[&["--port", "sevenbot://lab-3"], command].concat());
        let said = failed(&refused, 2);
        assert!(said.contains("sevenbot://lab-3 is a server"), "{said}");
    }
}
