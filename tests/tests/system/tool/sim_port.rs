//! `--port sim`: an arm simulated inside the command.

use super::output::{failed, run_without_arm, succeeded, words};

#[test]
fn each_command_has_an_arm_of_its_own_without_a_port() {
    let text = succeeded(run_without_arm(&["--port", "sim", "info"]));
    assert_eq!(words(&text, "motor state"), ["motor", "state", "servo"], "its servos are found");
    let pose = ["pose", "120", "90", "65", "90", "90", "90", "80", "--wait"];
    let text = succeeded(run_without_arm(&[&["--port", "sim:7"][..], &pose].concat()));
    assert!(text.starts_with("120 90 "), "{text}");
    let text = succeeded(run_without_arm(&["--port", "sim", "get", "present-position"]));
    assert_eq!(words(&text, "54")[2], "90", "a new arm: {text}");
}

#[test]
fn a_server_needs_an_arm_that_stays() {
    let text = failed(&run_without_arm(&["--port", "sim", "serve"]), 2);
    assert!(text.contains("cargo sim -- --link ./7bot"), "{text}");
}
