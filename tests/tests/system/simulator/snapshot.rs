//! `sevenbot sim snapshot` and `restore`: an arm goes back in time.

use std::fs;
use std::time::Duration;

use serde_json::json;
use system_tests::registers::{DEVICE_ID, EEPROM_LOCK, PRESENT_POSITION, TARGET_POSITION};
use system_tests::simulator::Simulator;
use system_tests::wait;

/// Moves joint 1, and returns the positions of forty reads.
fn movement(simulator: &Simulator) -> Vec<Vec<u8>> {
    let mut arm = simulator.client();
    arm.write(TARGET_POSITION, &[150]);
    (0..40).map(|_| arm.read(PRESENT_POSITION, 7)).collect()
}

#[test]
fn an_arm_goes_back_to_a_snapshot_and_does_the_same_again() {
    let simulator = Simulator::start(&["--lockstep", "60000", "--seed", "3"]);
    assert_eq!(simulator.says(&["snapshot", "before"]), "snapshot    before at 1.000 s\n");
    simulator.says(&["fault", "1=stuck"]);
    simulator.says(&["fault", "3=garbled=7", "--for", "50ms"]);
    simulator.says(&["weight", "200g"]);
    let other = movement(&simulator);
    assert!(simulator.state()["ended_faults"][0].is_object());
    simulator.says(&["snapshot", "after"]);
    assert_eq!(simulator.says(&["restore", "before"]), "snapshot    before at 1.000 s\n");
    let state = simulator.state();
    assert_eq!(
        (&state["time_us"], &state["weight_grams"], &state["ended_faults"], &state["faults"]),
        (&json!(1_000_000), &json!(0), &json!([]), &json!([]))
    );
    let first = movement(&simulator);
    simulator.says(&["restore", "before"]);
    assert_eq!(movement(&simulator), first);
    assert_ne!(first, other, "joint 1 is not stuck any more");
    simulator.says(&["restore", "after"]);
    assert_eq!(simulator.state()["weight_grams"], 200, "a later snapshot is still there");
}

#[test]
fn in_real_time_the_time_goes_back_and_passes_again() {
    let simulator = Simulator::start(&[]);
    simulator.says(&["pause"]);
    simulator.says(&["advance", "10s"]);
    simulator.says(&["snapshot", "a"]);
    let before = simulator.state();
    let mut arm = simulator.client();
    arm.write(TARGET_POSITION, &[120]);
    simulator.says(&["advance", "10s"]);
    assert_ne!(simulator.joint(1, "servo_position"), before["joints"][0]["servo_position"]);
    simulator.says(&["restore", "a"]);
    assert_eq!(simulator.state()["time_us"], before["time_us"]);
    assert_eq!(simulator.state()["joints"], before["joints"]);
    simulator.says(&["resume"]);
    wait::wait_until("time passes", || simulator.state()["time_us"] != before["time_us"]);
    assert_eq!(arm.register(TARGET_POSITION), 90, "the client is still connected");
}

#[test]
fn the_settings_of_a_snapshot_reach_their_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("settings.bin");
    let path = file.to_str().expect("text");
    let mut simulator = Simulator::start(&["--eeprom", path]);
    simulator.says(&["snapshot", "fresh"]);
    let fresh = fs::read(&file).expect("a file");
    let mut arm = simulator.client();
    arm.write(EEPROM_LOCK, &[0]);
    arm.write(DEVICE_ID, &[42]);
    wait::wait_until("it is stored", || fs::read(&file).expect("a file") != fresh);
    simulator.says(&["restore", "fresh"]);
    assert_eq!(fs::read(&file).expect("a file"), fresh);
    simulator.process.kill();
    let simulator = Simulator::start(&["--eeprom", path]);
    assert_ne!(simulator.client().register(DEVICE_ID), 42);
}

#[test]
fn what_has_no_snapshots_says_why() {
    let simulator = Simulator::start(&[]);
    let error = simulator.refuses(&["restore", "x"], 1);
    assert!(
        error.contains("there is no snapshot 'x'") && error.contains("`sevenbot sim snapshot NAME`"),
        "{error}"
    );
    simulator.says(&["snapshot", "a"]);
    simulator.says(&["snapshot", "b"]);
    let error = simulator.refuses(&["restore", "x"], 1);
    assert!(error.contains("there is no snapshot 'x'; there are: a, b"), "{error}");
    assert!(simulator.refuses(&["snapshot", ""], 1).contains("1 to 64"));
    for number in 2..64 {
        simulator.says(&["snapshot", &number.to_string()]);
    }
    assert!(simulator.refuses(&["snapshot", "more"], 1).contains("64 snapshots"));
    simulator.says(&["snapshot", "a"]);
    let arms = Simulator::start(&["--arms", "2"]);
    let socket = arms.sockets().remove(0);
    let error = arms.refuses(&["--control", socket.to_str().expect("text"), "snapshot", "a"], 1);
    assert!(error.contains("--arms"), "{error}");
    let file = arms.folder.path().join("session");
    let recorded = Simulator::start(&["--record", file.to_str().expect("text")]);
    for command in ["snapshot", "restore"] {
        assert!(recorded.refuses(&[command, "a"], 1).contains("without --record"), "{command}");
    }
    let mut arm = recorded.client();
    assert!(arm.try_read(DEVICE_ID, 1, Duration::from_secs(5)).is_some());
}
