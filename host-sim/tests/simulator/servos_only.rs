//! The built simulator as a servo bus behind a USB adapter: raw bytes on a port.

use crate::sim;

use std::fs;
use std::path::Path;
use std::time::Duration;

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
