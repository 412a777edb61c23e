//! The built simulator as a servo bus: raw bytes on the port of a USB adapter, or on a socket.

use crate::sim;

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::sim::{Bus, Sim};
use rustix::process::Signal;

/// The answer of a servo to a ping.
fn pong(id: u8) -> Vec<u8> {
    vec![0xFF, 0xFF, id, 2, 0, !(id + 2)]
}

fn start(link: &Path, more: &[&str]) -> Sim {
    Sim::start(&[&["--servos-only", "--link", link.to_str().unwrap()], more].concat())
}

#[test]
fn servos_answer_at_their_own_baud_rate_only() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("bus");
    let mut sim = start(&link, &["--servo-baud", "500000"]);
    assert_eq!(fs::read_link(&link).unwrap(), sim.port());
    let mut bus = Bus::open(&link, 500_000);
    assert_eq!(bus.ping_until_answered(3), pong(3));
    bus.set_baud(1_000_000);
    assert_eq!(bus.ping(3, Duration::from_millis(300)), []);
    bus.set_baud(500_000);
    assert_eq!(bus.ping_until_answered(3), pong(3));
    assert_eq!(sim.end_with(Signal::TERM), Some(0));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "the link is gone");
}

#[test]
fn servos_keep_the_chosen_ids_over_a_power_cycle() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("bus");
    let sim = start(&link, &["--ids", "42,3"]);
    let mut bus = Bus::open(&link, 1_000_000);
    assert_eq!(bus.ping_until_answered(42), pong(42));
    sim.signal(Signal::HUP);
    assert_eq!(bus.ping_until_answered(3), pong(3));
    assert_eq!(bus.ping_until_answered(42), pong(42));
    assert_eq!(bus.ping(0, Duration::from_millis(300)), []);
}

#[test]
fn echo_and_answer_are_in_one_block() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("bus");
    let mut sim = start(&link, &["--usb-latency", "20", "--fault", "bus=echo", "--trace", "-q"]);
    let mut bus = Bus::open(&link, 1_000_000);
    let question = [0xFF, 0xFF, 0, 2, 1, 0xFC];
    let whole = [question.to_vec(), pong(0)].concat();
    let mut answer = Vec::new();
    for _ in 0..100 {
        answer = bus.ping(0, Duration::from_millis(300));
        if answer.len() > question.len() {
            break;
        }
    }
    assert_eq!(answer, whole);
    assert_eq!(sim.end_with(Signal::TERM), Some(0));
    let told = sim.rest_of_stderr();
    assert!(told.contains("-> [ff, ff, 00, 02, 01, fc]") && told.contains("<- [ff, ff, 00"), "{told}");
}

#[test]
fn the_servos_keep_their_state_while_the_adapter_is_unplugged() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("bus");
    let sim = start(&link, &[]);
    let mut bus = Bus::open(&link, 1_000_000);
    bus.ping_until_answered(0);
    // No servo starts with the value 2, which is damping in one of the tables.
    bus.ask(&[0xFF, 0xFF, 0, 4, 3, 40, 2, !49], 6);
    sim.signal(Signal::USR1);
    sim::wait_until("the link is gone", || !link.is_symlink());
    drop(bus);
    sim.signal(Signal::USR1);
    sim::wait_until("the link is back", || link.exists());
    let mut bus = Bus::open(&link, 1_000_000);
    let torque_switch = [0xFF, 0xFF, 0, 4, 2, 40, 1, !47];
    assert_eq!(bus.ask(&torque_switch, 7), [0xFF, 0xFF, 0, 3, 0, 2, !5]);
}

#[test]
fn the_servos_behind_a_socket_move_on_without_a_controller() {
    let folder = tempfile::tempdir().unwrap();
    let (socket, angles) = (folder.path().join("servos"), folder.path().join("angles"));
    let _sim =
        Sim::start(&["--servo-socket", socket.to_str().unwrap(), "--angles", angles.to_str().unwrap()]);
    let mut controller = UnixStream::connect(&socket).unwrap();
    controller.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    // Torque, and a goal 189 counts away at 100 counts a second, until the servo has started and acknowledges both.
    let torque = [0xFF, 0xFF, 0, 4, 3, 40, 1, !48];
    let goal = [0xFF, 0xFF, 0, 9, 3, 42, 2, 188, 0, 0, 0, 100, !88];
    let end = Instant::now() + Duration::from_secs(60);
    loop {
        controller.write_all(&[torque.as_slice(), &goal].concat()).unwrap();
        match controller.read_exact(&mut [0; 12]) {
            Ok(()) => break,
            Err(error) => assert!(Instant::now() < end, "{error}"),
        }
    }
    drop(controller);
    let turned = || {
        // The last line may be incomplete.
        let text = fs::read_to_string(&angles).unwrap();
        let (whole, _) = text.rsplit_once('\n')?;
        let joint_1 = whole.lines().last()?.split(',').nth(1)?.parse::<f64>().ok()?;
        Some((joint_1 - 90.0).abs())
    };
    while turned().is_none_or(|degrees| degrees < 30.0) {
        assert!(Instant::now() < end, "{:?} degrees", turned());
        sleep(Duration::from_millis(50));
    }
}
