//! Many arms in one simulator: `host-sim --arms N`. Each is an arm of its own, and all end together.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use system_tests::line::PATIENCE;
use system_tests::programs::host_sim;
use system_tests::registers::{
    CHIP_ID, DEVICE_ID, EEPROM_LOCK, FEEDBACK_FREQUENCY, PRESENT_POSITION, SPEED, STANDARD_POSE,
};
use system_tests::{Line, near, read_request};
use tempfile::TempDir;

/// A simulator with several arms, with their links and settings in a folder of its own.
struct Arms {
    process: Child,
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
        let mut process = command.stdout(Stdio::piped()).spawn().expect("the simulator starts");
        let lines = BufReader::new(process.stdout.take().expect("a pipe")).lines().take(count);
        let ports = lines.map(|line| {
            let line = line.expect("a line of text");
            PathBuf::from(line.strip_prefix("ready ").expect("a port"))
        });
        let ports: Vec<_> = ports.collect();
        assert_eq!(ports.len(), count, "a line for each arm");
        Self { process, ports, folder }
    }

    fn link(&self, number: usize) -> PathBuf {
        self.folder.path().join(format!("7bot-{number}"))
    }

    /// Opens all of them by their links.
    fn open<const COUNT: usize>(&self) -> [Line; COUNT] {
        std::array::from_fn(|index| Line::open(&self.link(index + 1), 115_200))
    }

    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.process), signal).expect("the simulator is running");
    }

    fn wait(&mut self) -> ExitStatus {
        let deadline = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.process.try_wait().expect("a process to wait for") {
                return status;
            }
            assert!(Instant::now() < deadline, "it does not end");
            sleep(Duration::from_millis(5));
        }
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

impl Drop for Arms {
    fn drop(&mut self) {
        // Errors mean that it is gone already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < deadline, "waited in vain until {what}");
        sleep(Duration::from_millis(10));
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
fn what_one_arm_is_told_reaches_no_other() {
    let mut arms = Arms::start(3);
    let [mut first, mut second, mut third] = arms.open();
    wait_until("the servos are up", || {
        second.read(PRESENT_POSITION, 7).iter().zip(STANDARD_POSE).all(|(&is, wanted)| near(is, wanted))
    });
    second.write(EEPROM_LOCK, &[0]);
    second.write(DEVICE_ID, &[42]);
    second.write(SPEED, &[7]);
    assert_eq!((second.register(DEVICE_ID), second.register(SPEED)), (42, 7));
    for other in [&mut first, &mut third] {
        assert_eq!((other.register(DEVICE_ID), other.register(SPEED)), (0, 60));
        assert_eq!(other.register(EEPROM_LOCK), 1);
    }
    // Nor after a sudden death: each has its own file.
    drop([first, second, third]);
    arms.signal(Signal::KILL);
    arms.wait();
    let folder = std::mem::replace(&mut arms.folder, tempfile::tempdir().expect("another folder"));
    let arms = Arms::start_in(folder, 3);
    let ids = arms.open::<3>().map(|mut arm| arm.register(DEVICE_ID));
    assert_eq!(ids, [0, 42, 0]);
}

#[test]
fn ctrl_c_ends_all_of_them_and_takes_their_links_away() {
    let mut arms = Arms::start(3);
    let images = ["arm-1.bin", "arm-2.bin", "arm-3.bin"];
    assert_eq!(arms.files(), [["7bot-1", "7bot-2", "7bot-3"], images].concat());
    arms.open::<3>()[2].register(DEVICE_ID);
    arms.signal(Signal::INT);
    assert_eq!(arms.wait().code(), Some(0));
    assert_eq!(arms.files(), images);
}

#[test]
fn a_power_cycle_is_one_for_all() {
    let arms = Arms::start(2);
    let mut lines = arms.open::<2>();
    for arm in &mut lines {
        arm.write(SPEED, &[7]);
        assert_eq!(arm.register(SPEED), 7);
    }
    arms.signal(Signal::HUP);
    for arm in &mut lines {
        wait_until("RAM is empty", || arm.register(SPEED) == 60);
    }
}

#[test]
fn a_client_that_does_not_read_holds_up_nobody_else() {
    let arms = Arms::start(2);
    let [mut deaf, mut other] = arms.open();
    // 170 KB of answers: far more than the kernel holds.
    let writer = deaf.send_in_background(read_request(0, 61).repeat(2_500));
    other.write(FEEDBACK_FREQUENCY, &[50]);
    for _ in 0..50 {
        assert_eq!(other.read(CHIP_ID, 6), [0, 0, 0, 0, 0, 0xFF]);
    }
    (0..2_500).for_each(|_| assert_eq!(deaf.reply().values.len(), 61));
    writer.join().expect("all was sent");
}

/// More than a user has inotify instances (128), and than a process has files where the limit is low.
#[test]
fn two_hundred_arms_are_not_too_many() {
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -Sn 256; exec \"$0\" \"$@\""]).arg(host_sim()).args(["--eeprom", "none"]);
    let mut arms = Arms::launch(command, tempfile::tempdir().expect("a temporary folder"), 200);
    for (port, number) in arms.ports.iter().zip(0_u8..) {
        let id = u16::from(number) + 0xFE;
        let [high, low] = id.to_be_bytes();
        assert_eq!(Line::open(port, 115_200).read(CHIP_ID, 6), [0, 0, 0, 0, high, low]);
    }
    arms.signal(Signal::TERM);
    assert_eq!(arms.wait().code(), Some(0));
}
