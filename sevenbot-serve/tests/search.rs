//! An arm that was unplugged comes back under another name, among other devices. Simulated arms on pseudo-terminals.

#![cfg(target_os = "linux")]
#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver};
use std::sync::{LazyLock, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use motion_core::servo_bus::TorqueCodes;
use protocol_core::time::Instant;
use sevenbot_serve::server::{ArmLocation, Notice, Server, ServerConfig, ServerStop};
use tty_ports::pty::Pty;
use tty_ports::symlink::Symlink;

static START: LazyLock<std::time::Instant> = LazyLock::new(std::time::Instant::now);
/// The folder of the ports.
static FOLDER: OnceLock<PathBuf> = OnceLock::new();

fn port(name: &str) -> PathBuf {
    FOLDER.get().unwrap().join(name)
}

fn ports() -> Vec<PathBuf> {
    fs::read_dir(FOLDER.get().unwrap()).unwrap().map(|entry| entry.unwrap().path()).collect()
}

fn now() -> Instant {
    Instant::from_micros(u64::try_from(START.elapsed().as_micros()).unwrap())
}

/// Something that is plugged in; dropped, it is unplugged.
struct Plugged {
    stop: mpsc::Sender<()>,
    thread: Option<JoinHandle<()>>,
}

impl Plugged {
    /// An arm with a chip id; `None`: a device that never answers.
    fn plug(path: &Path, chip_id: Option<[u8; 6]>) -> Self {
        let pty = Pty::open(None).expect("a pseudo-terminal");
        let link = Symlink::new(path, pty.path()).expect("a link");
        let (stop, stopped) = mpsc::channel();
        let run = move || {
            let mut arm = chip_id.map(|chip_id| {
                let config = ArmConfig { chip_id, is_paced: false, torque_codes: TorqueCodes::default() };
                SimulatedArm::new(now(), config, Flash::in_memory(), Plant::new(now()))
            });
            while stopped.recv_timeout(Duration::from_millis(1)) == Err(mpsc::RecvTimeoutError::Timeout) {
                let mut bytes = [0; 64];
                let count = pty.read(&mut bytes).unwrap();
                let Some(arm) = &mut arm else { continue };
                assert_eq!(arm.host_send(now(), &bytes[..count]), count);
                arm.advance(now(), true);
                let written = pty.write(arm.host_received()).unwrap();
                arm.host_take(written);
            }
            drop(link);
        };
        Self { stop, thread: Some(thread::spawn(run)) }
    }
}

impl Drop for Plugged {
    fn drop(&mut self) {
        self.stop.send(()).expect("it is plugged in");
        self.thread.take().unwrap().join().expect("no error");
    }
}

fn next(notices: &Receiver<Notice>) -> Notice {
    notices.recv_timeout(Duration::from_secs(60)).expect("a notice")
}

#[test]
fn an_arm_that_comes_back_under_another_name_is_found_among_others() {
    let folder = std::env::temp_dir().join(format!("sevenbot-serve-search-{}", std::process::id()));
    fs::create_dir(&folder).expect("a folder");
    FOLDER.set(folder.clone()).unwrap();
    let (arm, other_arm) = (Some([1; 6]), Some([2; 6]));
    let plugged = Plugged::plug(&port("ttyUSB0"), arm);
    let _silent = Plugged::plug(&port("ttyUSB1"), None);
    let stop = ServerStop::default();
    let trigger = stop.clone();
    let (sender, notices) = mpsc::channel();
    let server = thread::spawn(move || {
        let location = ArmLocation::Search { first: port("ttyUSB0"), list: ports };
        let config = ServerConfig::new(Some(location), 115_200);
        Server::open(config).expect("a server").run(&stop, &mut |notice| drop(sender.send(notice)))
    });
    assert_eq!(next(&notices), Notice::ArmFound(port("ttyUSB0")));
    drop(plugged);
    assert!(matches!(next(&notices), Notice::ArmLost { .. }));
    let _other = Plugged::plug(&port("ttyUSB2"), other_arm);
    let _new_silent = Plugged::plug(&port("ttyUSB3"), None);
    let plugged = Plugged::plug(&port("ttyUSB4"), arm);
    assert_eq!(next(&notices), Notice::ArmFound(port("ttyUSB4")), "no other arm, and no notice between");
    drop(plugged);
    assert!(matches!(next(&notices), Notice::ArmLost { .. }));
    let _plugged = Plugged::plug(&port("ttyUSB0"), arm);
    assert_eq!(next(&notices), Notice::ArmFound(port("ttyUSB0")));
    trigger.stop();
    server.join().expect("no panic").expect("no error");
    fs::remove_dir_all(folder).expect("its end");
}
