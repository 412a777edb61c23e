//! The built simulator as a user sees it: first line, files, signals, exit statuses.

use crate::sim;

use std::fs;
use std::io::Read;
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use crate::sim::{Client, Sim, complaint, refused};
use protocol_core::registers::map::{
    DEVICE_ID, EEPROM_LOCK, FAULTS, MISSING_SERVOS, PRESENT_POSITION, SPEED, TARGET_POSITION, fault,
};
use rustix::process::Signal;

#[test]
fn the_first_line_names_a_port_that_can_be_opened_and_is_the_only_one() {
    let mut sim = Sim::start(&["--eeprom", "none"]);
    let metadata = fs::metadata(sim.port()).unwrap();
    assert!(metadata.file_type().is_char_device());
    assert_eq!(metadata.permissions().mode() & 0o777, 0o600);
    let mut client = Client::open(sim.port());
    assert_eq!(client.read(DEVICE_ID.address, 1).len(), 1);
    assert_eq!(sim.end_with(Signal::TERM), Some(0));
    assert_eq!(sim.rest_of_stdout(), "");
}

#[test]
fn the_link_exists_while_the_simulator_runs() {
    let directory = tempfile::tempdir().unwrap();
    let link = directory.path().join("7bot");
    std::os::unix::fs::symlink("/dev/pts/stale", &link).unwrap();
    let mut sim = Sim::start(&["--eeprom", "none", "--link", link.to_str().unwrap()]);
    assert_eq!(fs::read_link(&link).unwrap(), sim.port());
    Client::open(&link).read(PRESENT_POSITION.address, 7);
    assert_eq!(sim.end_with(Signal::INT), Some(0));
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
}

#[test]
fn a_file_at_the_path_of_the_link_is_not_changed() {
    let directory = tempfile::tempdir().unwrap();
    let link = directory.path().join("thesis.tex");
    fs::write(&link, "years").unwrap();
    let line = refused(&["--eeprom", "none", "--link", link.to_str().unwrap()]);
    assert!(line.contains("thesis.tex") && line.contains("choose another path"), "{line}");
    assert_eq!(fs::read(&link).unwrap(), b"years");
}

#[test]
fn a_second_simulator_leaves_the_link_of_the_first() {
    let state = tempfile::tempdir().unwrap();
    let link = state.path().join("link");
    let arguments = ["--link", link.to_str().unwrap()];
    let mut first = Sim::start_in(state.path(), &arguments);
    let line = complaint(&mut sim::command(state.path(), &arguments));
    assert!(line.contains("in use"), "{line}");
    for kind in [&["--eeprom", "none"][..], &["--servos-only"]] {
        let line = refused(&[kind, &arguments].concat());
        assert!(line.contains("leads to /dev/pts/") && line.contains("choose another path"), "{line}");
    }
    assert_eq!(fs::read_link(&link).unwrap(), first.port());
    Client::open(&link).read(PRESENT_POSITION.address, 7);
    assert_eq!(first.end_with(Signal::TERM), Some(0));
    assert!(!link.is_symlink());
}

#[test]
fn the_link_of_a_killed_simulator_is_replaced() {
    let directory = tempfile::tempdir().unwrap();
    let link = directory.path().join("7bot");
    let arguments = ["--eeprom", "none", "--link", link.to_str().unwrap()];
    assert_eq!(Sim::start(&arguments).end_with(Signal::KILL), None);
    // Another process may own a terminal with the old number by now. Then the link is refused.
    if fs::metadata(&link).is_err() {
        let next = Sim::start(&arguments);
        assert_eq!(fs::read_link(&link).unwrap(), next.port());
    }
}

#[test]
fn a_link_of_the_user_and_an_error_at_the_start_change_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let (own, new) = (directory.path().join("own"), directory.path().join("new"));
    std::os::unix::fs::symlink("/dev/ttyUSB-unplugged", &own).unwrap();
    let line = refused(&["--eeprom", "none", "--link", own.to_str().unwrap()]);
    assert!(line.contains("is not replaced"), "{line}");
    assert_eq!(fs::read_link(&own).unwrap(), std::path::Path::new("/dev/ttyUSB-unplugged"));
    refused(&["-q", "--eeprom", "none", "--link", new.to_str().unwrap(), "--control", "/nowhere/control"]);
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
}

#[test]
fn only_one_simulator_can_use_an_image() {
    let directory = tempfile::tempdir().unwrap();
    let image = directory.path().join("arm.bin");
    let image = image.to_str().unwrap();
    let _first = Sim::start(&["--eeprom", image]);
    let line = refused(&["--eeprom", image]);
    assert!(line.contains("in use") && line.contains("--eeprom none"), "{line}");
}

#[test]
fn by_default_the_image_is_in_the_state_directory() {
    let state = tempfile::tempdir().unwrap();
    let _first = Sim::start_in(state.path(), &[]);
    let image = state.path().join("7bot/eeprom.bin");
    assert_eq!(fs::metadata(&image).unwrap().len(), 32_768);
    assert_eq!(fs::metadata(&image).unwrap().permissions().mode() & 0o777, 0o600);
    let line = complaint(&mut sim::command(state.path(), &[]));
    assert!(line.contains("--eeprom FILE") && line.contains("--eeprom none"), "{line}");
    let bus = state.path().join("bus");
    let bus = bus.to_str().unwrap();
    let _servos = Sim::start(&["--servos-only", "--link", bus]);
    let _second = Sim::start_in(state.path(), &["--servos", bus]);
    assert!(state.path().join("7bot/servos.bin").exists(), "real servos have settings of their own");
}

#[test]
fn a_file_that_is_no_settings_image_is_refused_and_not_changed() {
    let directory = tempfile::tempdir().unwrap();
    let image = directory.path().join("arm.bin");
    for (content, says) in [(vec![0xA5; 32_768], "damaged"), (vec![0xFF; 100], "100 bytes long")] {
        fs::write(&image, &content).unwrap();
        let line = refused(&["--eeprom", image.to_str().unwrap()]);
        assert!(line.contains(says) && line.contains("delete it"), "{line}");
        assert_eq!(fs::read(&image).unwrap(), content);
    }
}

#[test]
fn a_wrong_command_line_is_refused_in_one_line() {
    for (arguments, says) in [
        (vec!["--eprom", "x"], "--eeprom"),
        (vec!["--chip-id", "xyz"], "12 hexadecimal digits"),
        (vec!["--fault", "8=missing"], "1 to 7"),
        (vec!["--servos-only", "--fault", "line=loss=1%"], "no host line"),
        (vec!["--eeprom", "none", "--link", "/nowhere/7bot"], "/nowhere/7bot"),
        (vec!["--eeprom", "/nowhere/arm.bin"], "/nowhere/arm.bin"),
        (vec!["--servo-socket", "/nowhere/servos"], "/nowhere/servos"),
        (vec!["--servo-socket", "servos", "--angles", "/nowhere/angles"], "--angles /nowhere/angles"),
    ] {
        let line = refused(&arguments);
        assert!(line.contains(says), "{line}");
    }
}

#[test]
fn help_has_examples() {
    let state = tempfile::tempdir().unwrap();
    let output = sim::command(state.path(), &["--help"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let help = String::from_utf8(output.stdout).unwrap();
    for word in [
        "host-sim --link ./7bot",
        "SIGHUP",
        "SIGUSR2",
        "arm=supported",
        "EXIT STATUS",
        "--servo-socket",
        "--unpaced",
    ] {
        assert!(help.contains(word), "{word}");
    }
}

#[test]
fn sighup_is_a_power_cycle_and_the_port_stays() {
    let sim = Sim::start(&["--eeprom", "none"]);
    let mut client = Client::open(sim.port());
    client.write(EEPROM_LOCK.address, &[0]);
    client.write(DEVICE_ID.address, &[42]);
    client.write(SPEED.address, &[7]);
    assert_eq!(client.read(SPEED.address, 1), [7]);
    sim.signal(Signal::HUP);
    client.read_until(SPEED.address, &[60]);
    assert_eq!(client.read(DEVICE_ID.address, 1), [42], "settings are kept");
    assert_eq!(client.read(EEPROM_LOCK.address, 1), [1], "and protected again");
}

#[test]
fn sigusr1_has_no_effect_without_an_adapter() {
    let directory = tempfile::tempdir().unwrap();
    let link = directory.path().join("7bot");
    let mut sim = Sim::start(&["--eeprom", "none", "--link", link.to_str().unwrap()]);
    sim.signal(Signal::USR1);
    Client::open(&link).read(PRESENT_POSITION.address, 7);
    assert_eq!(sim.end_with(Signal::TERM), Some(0));
    let told = sim.rest_of_stderr();
    assert!(told.contains("SIGUSR1 is ignored"), "{told}");
}

#[test]
fn sigusr2_restarts_the_controller_and_the_servos_hold() {
    let sim = Sim::start(&["--eeprom", "none"]);
    let mut client = Client::open(sim.port());
    client.write(TARGET_POSITION.address, &[100]);
    client.read_until(PRESENT_POSITION.address, &[100]);
    client.write(SPEED.address, &[7]);
    assert_eq!(client.read(SPEED.address, 1), [7]);
    sim.signal(Signal::USR2);
    client.read_until(FAULTS.address, &[fault::WATCHDOG_RESTART]);
    assert_eq!(client.read(SPEED.address, 1), [60], "registers in RAM are lost");
    client.read_until(TARGET_POSITION.address, &[100]);
    let present = client.read(PRESENT_POSITION.address, 7);
    // The forearm droops by 0.7 degrees.
    let is_held = present.iter().zip([100, 90, 66, 90, 90, 90, 80]).all(|(is, held)| is.abs_diff(held) <= 1);
    assert!(is_held, "{present:?}");
}

#[test]
fn settings_survive_a_kill() {
    let directory = tempfile::tempdir().unwrap();
    let image = directory.path().join("arm.bin");
    let arguments = ["--eeprom", image.to_str().unwrap()];
    for id in 1..=5 {
        let mut sim = Sim::start(&arguments);
        let mut client = Client::open(sim.port());
        assert_eq!(client.read(DEVICE_ID.address, 1), [id - 1]);
        client.write(EEPROM_LOCK.address, &[0]);
        client.write(DEVICE_ID.address, &[id]);
        assert_eq!(client.read(DEVICE_ID.address, 1), [id]);
        assert_eq!(sim.end_with(Signal::KILL), None);
    }
}

#[test]
fn requests_of_a_client_that_leaves_are_executed_and_the_next_client_gets_no_old_answers() {
    let sim = Sim::start(&["--eeprom", "none"]);
    let mut first = Client::open(sim.port());
    for _ in 0..200 {
        first.send_read(0, 61);
    }
    drop(first);
    let mut second = Client::open(sim.port());
    second.write(SPEED.address, &[7]);
    drop(second);
    let mut third = Client::open(sim.port());
    third.read_until(SPEED.address, &[7]);
}

#[test]
fn a_client_that_reads_late_gets_every_answer() {
    let sim = Sim::start(&["--eeprom", "none", "--unpaced"]);
    let mut client = Client::open(sim.port());
    let mut reader = Client::open(sim.port());
    // 34 KB of answers do not fit the kernel's buffers, so the simulator has to wait.
    let writer = std::thread::spawn(move || (0..500).for_each(|_| client.send_read(0, 61)));
    std::thread::sleep(Duration::from_millis(300));
    for _ in 0..500 {
        assert_eq!(reader.answer(0, 61).len(), 61);
    }
    writer.join().unwrap();
}

#[test]
fn the_simulator_runs_with_closed_outputs() {
    let directory = tempfile::tempdir().unwrap();
    let link = directory.path().join("7bot");
    let arguments = ["--eeprom", "none", "--trace", "-vv", "--link", link.to_str().unwrap()];
    let mut sim = Sim::start(&arguments);
    sim.close_output();
    let mut client = Client::open(&link);
    client.read(PRESENT_POSITION.address, 7);
    sim.signal(Signal::HUP);
    client.read(PRESENT_POSITION.address, 7);
    assert_eq!(sim.end_with(Signal::TERM), Some(0));
}

#[test]
fn trace_shows_frames_as_text_on_standard_error() {
    let mut sim = Sim::start(&["--eeprom", "none", "-q", "--trace"]);
    Client::open(sim.port()).read(DEVICE_ID.address, 1);
    sim.end_with(Signal::TERM);
    let told = sim.rest_of_stderr();
    assert!(told.contains("-> read device-id\n") && told.contains("<- answer device-id = 0\n"), "{told}");
    assert!(!told.contains('\u{1b}'), "no colours in a pipe: {told}");
}

#[test]
fn faults_of_the_command_line_take_effect() {
    let sim = Sim::start(&[
        "--eeprom",
        "none",
        "--fault",
        "3=missing",
        "--fault",
        "5=garbled",
        "--fault",
        "bus=echo",
    ]);
    Client::open(sim.port()).read_until(MISSING_SERVOS.address, &[0b001_0100]);
}

#[test]
fn servos_without_a_controller_answer_on_a_socket() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("servos.sock");
    let arguments = ["--servo-socket", path.to_str().unwrap()];
    let mut sim = Sim::start(&arguments);
    assert_eq!(sim.port(), path);
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    let line = refused(&arguments);
    assert!(line.contains("another simulator"), "{line}");
    for _ in 0..3 {
        let mut bus = UnixStream::connect(&path).unwrap();
        assert_eq!(ping(&mut bus), [0xFF, 0xFF, 0x00, 0x02, 0x00, 0xFD]);
    }
    assert_eq!(sim.end_with(Signal::TERM), Some(0));
    assert!(!path.exists());
}

#[test]
fn a_stale_servo_socket_is_replaced() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("servos.sock");
    let arguments = ["--servo-socket", path.to_str().unwrap()];
    Sim::start(&arguments).end_with(Signal::KILL);
    assert!(path.exists());
    let _sim = Sim::start(&arguments);
    ping(&mut UnixStream::connect(&path).unwrap());
}

/// Pings servo 0 until it answers: a servo does not answer until it has started.
fn ping(bus: &mut UnixStream) -> [u8; 6] {
    bus.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    for _ in 0..300 {
        std::io::Write::write_all(bus, b"\xff\xff\x00\x02\x01\xfc").unwrap();
        let mut answer = [0; 6];
        if bus.read_exact(&mut answer).is_ok() {
            return answer;
        }
    }
    panic!("no servo answers");
}
