//! The arm loses its power behind an adapter that stays: the port is open, and nothing answers. A simulated arm on a pseudo-terminal.

#![cfg(target_os = "linux")]
#![allow(clippy::expect_used, clippy::unwrap_used)] // A panic is a failed test.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, mpsc};
use std::thread;
use std::time::Duration;

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use motion_core::servo_bus::TorqueCodes;
use protocol_core::time::Instant;
use sevenbot_serve::server::{ArmLocation, ClassConfig, Notice, Server, ServerConfig, ServerStop};
use tty_ports::pty::Pty;

static START: LazyLock<std::time::Instant> = LazyLock::new(std::time::Instant::now);

fn now() -> Instant {
    Instant::from_micros(u64::try_from(START.elapsed().as_micros()).unwrap())
}

fn powered_up() -> SimulatedArm<Flash> {
    let config = ArmConfig { chip_id: [1; 6], is_paced: false, torque_codes: TorqueCodes::default() };
    SimulatedArm::new(now(), config, Flash::in_memory(), Plant::new(now()))
}

/// Simulates the adapter and its arm until it is stopped.
fn run_adapter(pty: &Pty, has_power: &AtomicBool, stop: &mpsc::Receiver<()>) {
    let mut arm = None;
    while stop.recv_timeout(Duration::from_millis(1)) == Err(mpsc::RecvTimeoutError::Timeout) {
        let mut bytes = [0; 64];
        let count = pty.read(&mut bytes).unwrap();
        if !has_power.load(Ordering::Relaxed) {
            arm = None;
            continue;
        }
        let arm = arm.get_or_insert_with(powered_up);
        assert_eq!(arm.host_send(now(), bytes.get(..count).unwrap()), count);
        arm.advance(now(), true);
        let written = pty.write(arm.host_received()).unwrap();
        arm.host_take(written);
    }
}

#[test]
fn the_server_of_a_class_notices_that_the_arm_does_not_answer_although_nobody_reads() {
    let pty = Pty::open(None).expect("a pseudo-terminal");
    let port = PathBuf::from(pty.path());
    let has_power = Arc::new(AtomicBool::new(true));
    let (stop_adapter, adapter_stopped) = mpsc::channel();
    let adapter = thread::spawn({
        let has_power = Arc::clone(&has_power);
        move || run_adapter(&pty, &has_power, &adapter_stopped)
    });
    let class = ClassConfig {
        address: SocketAddr::from(([127, 0, 0, 1], 0)),
        files: |_| None,
        code: None,
        secret: "secret".to_owned(),
        hosts: Vec::new(),
        new_key: || None,
    };
    let arm = Some(ArmLocation::Port(port.clone()));
    let server = Server::open(ServerConfig { class: Some(class), ..ServerConfig::new(arm, 115_200) })
        .expect("it opens");
    let stop = ServerStop::default();
    let trigger = stop.clone();
    let (sender, notices) = mpsc::channel();
    let running = thread::spawn(move || server.run(&stop, &mut |notice| drop(sender.send(notice))));
    let next = || notices.recv_timeout(Duration::from_secs(60)).expect("a notice");
    assert_eq!(next(), Notice::ArmFound(port.clone()));
    for _ in 0..2 {
        has_power.store(false, Ordering::Relaxed);
        assert_eq!(next(), Notice::ArmSilent(port.clone()));
        has_power.store(true, Ordering::Relaxed);
        assert_eq!(next(), Notice::ArmFound(port.clone()));
    }
    trigger.stop();
    running.join().expect("no panic").expect("no error");
    stop_adapter.send(()).expect("it runs");
    adapter.join().expect("no panic");
}
