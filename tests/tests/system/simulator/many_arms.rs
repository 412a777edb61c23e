//! Many arms in one simulator: `host-sim --arms N`. They share nothing but the process.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use system_tests::process::{self, RunningProgram, Signal, send_signal, wait_for_exit};
use system_tests::programs::host_sim;
use system_tests::registers::{
    CHIP_ID, DEVICE_ID, EEPROM_LOCK, FEEDBACK_FREQUENCY, PRESENT_POSITION, SPEED, STANDARD_POSE,
};
use system_tests::wait::wait_until;
use system_tests::{ArmClient, near, read_request};
use tempfile::TempDir;

/// A simulator with several arms, and a folder with their links and settings.
struct Arms {
    process: RunningProgram,
    ports: Vec<PathBuf>,
    folder: TempDir,
}

impl Arms {
    fn start(count: usize) -> Self {
        Self::start_in(tempfile::tempdir().expect("a temporary folder"), count)
    }

    fn start_in(folder: TempDir, count: usize) -> Self {
        let mut command = Command::new(host_sim());
        command
            .arg("--link")
            .arg(folder.path().join("7bot"))
            .arg("--eeprom")
            .arg(folder.path().join("arm.bin"));
        Self::launch(command, folder, count)
    }

    fn launch(mut command: Command, folder: TempDir, count: usize) -> Self {
        command.args(["--quiet", "--unpaced", "--chip-id", "0000000000fe", "--arms", &count.to_string()]);
        let (process, ports) = process::start(&mut command, count).expect("the simulator is ready");
        Self { process, ports, folder }
    }

    fn link(&self, number: usize) -> PathBuf {
        self.folder.path().join(format!("7bot-{number}"))
    }

    /// Opens all arms by their links.
    fn open<const COUNT: usize>(&self) -> [ArmClient; COUNT] {
        std::array::from_fn(|index| ArmClient::open(&self.link(index + 1), 115_200))
    }

    fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).expect("a folder");
        let mut names: Vec<_> = entries
            .map(|entry| entry.expect("an entry").file_name().into_string().expect("a name"))
            .collect();
        names.sort();
        names
    }
}

#[test]
fn each_arm_answers_with_its_own_chip_id_on_its_own_port() {
    let arms = Arms::start(3);
    for (port, number) in arms.ports.iter().zip(1..) {
        assert_eq!(fs::read_link(arms.link(number)).expect("a link"), *port);
    }
    let ids = [[0, 0, 0, 0, 0, 0xFE], [0, 0, 0, 0, 0, 0xFF], [0, 0, 0, 0, 1, 0]];
    for (arm, id) in arms.open::<3>().iter_mut().zip(ids) {
        assert_eq!(arm.read(CHIP_ID, 6), id);
    }
}

#[test]
fn a_write_reaches_one_arm_only() {
    let mut arms = Arms::start(3);
    let [mut first, mut second, mut third] = arms.open();
    wait_until("the servos have started", || {
        second
            .read(PRESENT_POSITION, 7)
            .iter()
            .zip(STANDARD_POSE)
            .all(|(&actual, expected)| near(actual, expected))
    });
    second.write(EEPROM_LOCK, &[0]);
    second.write(DEVICE_ID, &[42]);
    second.write(SPEED, &[7]);
    assert_eq!((second.register(DEVICE_ID), second.register(SPEED)), (42, 7));
    for other in [&mut first, &mut third] {
        assert_eq!((other.register(DEVICE_ID), other.register(SPEED)), (0, 60));
        assert_eq!(other.register(EEPROM_LOCK), 1);
    }
    // This also holds after a kill: each arm has its own settings file.
    drop([first, second, third]);
    send_signal(&arms.process, Signal::KILL);
    wait_for_exit(&mut arms.process);
    let folder = std::mem::replace(&mut arms.folder, tempfile::tempdir().expect("another folder"));
    let arms = Arms::start_in(folder, 3);
    let ids = arms.open::<3>().map(|mut arm| arm.register(DEVICE_ID));
    assert_eq!(ids, [0, 42, 0]);
}

#[test]
fn ctrl_c_ends_all_arms_and_removes_their_links() {
    let mut arms = Arms::start(3);
    let images = ["arm-1.bin", "arm-2.bin", "arm-3.bin"];
    assert_eq!(arms.files(), [["7bot-1", "7bot-2", "7bot-3"], images].concat());
    arms.open::<3>()[2].register(DEVICE_ID);
    send_signal(&arms.process, Signal::INT);
    assert_eq!(wait_for_exit(&mut arms.process).code(), Some(0));
    assert_eq!(arms.files(), images);
}

#[test]
fn a_power_cycle_restarts_all_arms() {
    let arms = Arms::start(2);
    let mut lines = arms.open::<2>();
    for arm in &mut lines {
        arm.write(SPEED, &[7]);
        assert_eq!(arm.register(SPEED), 7);
    }
    send_signal(&arms.process, Signal::HUP);
    for arm in &mut lines {
        wait_until("the RAM has its defaults", || arm.register(SPEED) == 60);
    }
}

#[test]
fn a_client_that_does_not_read_delays_no_other_arm() {
    let arms = Arms::start(2);
    let [mut blocked, mut other] = arms.open();
    // 170 KB of replies exceed the buffers of the kernel.
    let writer = blocked.send_in_background(read_request(0, 61).repeat(2_500));
    other.write(FEEDBACK_FREQUENCY, &[50]);
    for _ in 0..50 {
        assert_eq!(other.read(CHIP_ID, 6), [0, 0, 0, 0, 0, 0xFF]);
    }
    (0..2_500).for_each(|_| assert_eq!(blocked.reply().values.len(), 61));
    writer.join().expect("all was sent");
}

/// Two hundred arms exceed the limit of inotify instances of a user (128), and their open files exceed the soft limit (256).
#[test]
fn two_hundred_arms_run_within_the_limits_of_a_user() {
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -Sn 256; exec \"$0\" \"$@\""]).arg(host_sim()).args(["--eeprom", "none"]);
    let mut arms = Arms::launch(command, tempfile::tempdir().expect("a temporary folder"), 200);
    for (port, number) in arms.ports.iter().zip(0_u8..) {
        let id = u16::from(number) + 0xFE;
        let [high, low] = id.to_be_bytes();
        assert_eq!(ArmClient::open(port, 115_200).read(CHIP_ID, 6), [0, 0, 0, 0, high, low]);
    }
    send_signal(&arms.process, Signal::TERM);
    assert_eq!(wait_for_exit(&mut arms.process).code(), Some(0));
}
