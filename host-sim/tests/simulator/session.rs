//! `--record` and `--replay`: a session is recorded in real time and replayed in virtual time.

use crate::sim;

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::sim::{Client, Sim, command};
use protocol_core::registers::map::{
    DEVICE_ID, EEPROM_LOCK, FEEDBACK_FREQUENCY, PRESENT_POSITION, TARGET_POSITION,
};
use rustix::process::Signal;

/// Records a session: a client moves an arm with a bad servo, stores a setting, and reads while reports come. Then come a power
/// cycle, a restart of the controller, and a second client.
fn record(file: &Path, arguments: &[&str]) {
    let common = ["--record", file.to_str().unwrap(), "--fault", "3=garbled=4", "--seed", "5"];
    let mut sim = Sim::start(&[&common, arguments].concat());
    let mut client = Client::open(sim.port());
    client.write(EEPROM_LOCK.address, &[0]);
    client.write(DEVICE_ID.address, &[42]);
    client.write(FEEDBACK_FREQUENCY.address, &[50]);
    client.write(TARGET_POSITION.address, &[120, 90, 65, 90, 90, 90, 0]);
    for _ in 0..100 {
        client.read(0, 61);
    }
    sim.signal(Signal::HUP);
    client.read_until(DEVICE_ID.address, &[42]);
    sim.signal(Signal::USR2);
    client.write(TARGET_POSITION.address, &[100]);
    client.read_until(PRESENT_POSITION.address, &[100]);
    drop(client);
    Client::open(sim.port()).read(DEVICE_ID.address, 1);
    assert_eq!(sim.end_with(Signal::TERM), Some(0));
}

fn replay(file: &Path) -> Output {
    let state = tempfile::tempdir().unwrap();
    command(state.path(), &["--replay", file.to_str().unwrap()]).output().unwrap()
}

#[test]
fn a_replay_of_a_recorded_session_is_equal() {
    let folder = tempfile::tempdir().unwrap();
    let settings = folder.path().join("settings.bin");
    let settings = settings.to_str().unwrap();
    for (number, arguments) in
        [&["--eeprom", "none"][..], &["--eeprom", settings], &["--eeprom", settings, "--unpaced"]]
            .iter()
            .enumerate()
    {
        let file = folder.path().join(format!("{number}.session"));
        record(&file, arguments);
        let output = replay(&file);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {errors}");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(text.ends_with("lines replayed, all equal\n"), "{text}");
    }
}

#[test]
fn a_replay_that_differs_says_where_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("session");
    record(&file, &["--eeprom", "none"]);
    let text = fs::read_to_string(&file).unwrap();
    // Change a byte of a recorded answer.
    let frame = "< aa7703";
    // Skip a line that ends within the head of a frame.
    let is_longer = |&(at, _): &(usize, &str)| !text[at + frame.len()..].starts_with('\n');
    let (start, _) = text.match_indices(frame).find(is_longer).unwrap();
    let (before, after) = (&text[..start], &text[start + frame.len() + 2..]);
    let changed = format!("{before}{frame}ff{after}");
    fs::write(&file, changed).unwrap();
    let output = replay(&file);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("byte 4 differs") && errors.contains("In the session this was '<- "), "{errors}");
}

#[test]
fn a_recording_is_replaced_only_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("session");
    fs::write(&file, "years").unwrap();
    let arguments = ["--quiet", "--eeprom", "none", "--record", file.to_str().unwrap()];
    let errors = sim::refused(&arguments);
    assert!(errors.contains("the file exists") && errors.contains("--force"), "{errors}");
    assert_eq!(fs::read(&file).unwrap(), b"years");
    let mut sim = Sim::start(&[&arguments[..], &["--force"]].concat());
    assert_eq!(sim.end_with(Signal::TERM), Some(0));
    assert!(fs::read_to_string(&file).unwrap().starts_with("7bot-session"));
}

#[test]
fn what_cannot_be_replayed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing");
    let errors = sim::refused(&["--replay", missing.to_str().unwrap()]);
    assert!(errors.contains("cannot read"), "{errors}");
    let other = folder.path().join("other");
    fs::write(&other, "not a session\n").unwrap();
    let errors = sim::refused(&["--replay", other.to_str().unwrap()]);
    assert!(errors.contains("does not begin with '7bot-session"), "{errors}");
}
