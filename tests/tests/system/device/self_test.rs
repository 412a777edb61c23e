//! The self-test image for the first power-up of a board, in the emulator: the messages of each step on the host link, and
//! the frames on the servo line.
//!
//! Runs with `ARM=emulator` only.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use std::{env, fs, thread};

use serialport::SerialPort;
use system_tests::process::{self, RunningProgram};
use system_tests::programs::xtask;
use system_tests::wait::wait_for;
use tempfile::TempDir;

/// Instructions to servos (hardware of the SCS series): ping, read, sync write.
const PING: u8 = 0x01;
const READ: u8 = 0x02;
const SYNC_WRITE: u8 = 0x83;
/// The fault handler sends this four times: it sets the torque switch (register 40) of seven servos to 0, damping.
const DAMPING: [u8; 22] = [0xFF, 0xFF, 0xFE, 18, 0x83, 40, 1, 0, 0, 1, 0, 2, 0, 3, 0, 4, 0, 5, 0, 6, 0, 0x2E];
const REPEATS: usize = 4;
/// The number of frames without an echo after which the image reports no echo.
const ECHO_TRIES: usize = 20;

/// The image in an emulator, with its port.
struct SelfTest {
    _process: RunningProgram,
    port: Box<dyn SerialPort>,
    received: String,
    servo_line: PathBuf,
    _folder: TempDir,
}

impl SelfTest {
    /// Starts the image, with options of the emulator.
    fn start(options: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let servo_line = folder.path().join("servo-line");
        let mut command = Command::new(xtask());
        command.args(["emulate", "--no-build", "--self-test", "--servo-line"]).arg(&servo_line).args(options);
        let (process, ports) = process::start(&mut command, 1).expect("the emulator is ready");
        let port =
            serialport::new(ports[0].to_string_lossy(), 115_200).timeout(Duration::from_millis(100)).open();
        let port = port.expect("the port opens");
        Self { _process: process, port, received: String::new(), servo_line, _folder: folder }
    }

    /// Sends a command, and returns the next line with this beginning.
    fn command(&mut self, letter: u8, beginning: &str) -> String {
        self.port.write_all(&[letter]).expect("the port takes bytes");
        self.line(beginning)
    }

    /// Returns the next line with this beginning. Skips the lines before it.
    fn line(&mut self, beginning: &str) -> String {
        wait_for(beginning, || {
            while let Some((line, rest)) = self.received.split_once("\r\n") {
                let (line, rest) = (line.to_owned(), rest.to_owned());
                self.received = rest;
                if line.starts_with(beginning) {
                    return Ok(line);
                }
            }
            let mut bytes = [0; 256];
            let count = self.port.read(&mut bytes).unwrap_or(0);
            self.received.push_str(&String::from_utf8_lossy(&bytes[..count]));
            Err(format!("{:?}", self.received))
        })
    }
}

/// The frames in a file. It must contain nothing else.
fn frames(path: &Path) -> Vec<Vec<u8>> {
    let bytes = fs::read(path).expect("the bytes on the servo line");
    let mut rest = bytes.as_slice();
    let mut frames = Vec::new();
    while let [0xFF, 0xFF, _, length, ..] = *rest {
        let (frame, after) = rest.split_at(4 + usize::from(length));
        let sum = frame[2..].iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        assert_eq!(sum, 0xFF, "checksum of {frame:02x?}");
        frames.push(frame.to_vec());
        rest = after;
    }
    assert!(rest.is_empty(), "not a frame: {rest:02x?}");
    frames
}

/// Tries step c until it passes. Replies may be late on a busy machine, and the servos take time to start.
fn check_one_servo(image: &mut SelfTest) {
    for _ in 0..20 {
        let mut lines = vec![image.command(b'c', "c: ")];
        while !lines.last().is_some_and(|line| line == "c: passed" || line == "c: FAILED") {
            lines.push(image.line("c: "));
        }
        if let [found, reading, verdict] = lines.as_slice()
            && verdict == "c: passed"
        {
            assert!(found.contains(": 100 of 100 answers, the longest after "), "{found}");
            assert!(reading.contains("74 x 0.1 V") && reading.ends_with("torque switch 0"), "{reading}");
            return;
        }
    }
    panic!("step c does not pass");
}

/// Tries step d until it passes. The image repeats this step until the next command.
fn check_seven_servos(image: &mut SelfTest) {
    let mut poses = image.command(b'd', "d: counts");
    for _ in 0..20 {
        if image.line("d: ") == "d: passed" {
            assert!(!poses.contains("-1"), "{poses}");
            assert!(poses.ends_with("torque switches [0, 0, 0, 0, 0, 0, 0]"), "{poses}");
            return;
        }
        poses = image.line("d: counts");
    }
    panic!("step d does not pass");
}

/// Is the test skipped, because `ARM` is not `emulator`? If so, prints the reason.
fn is_skipped() -> bool {
    let is_skipped = env::var_os("ARM").is_none_or(|arm| arm != "emulator");
    if is_skipped {
        eprintln!("skipped self_test: the image for the first power-up runs with ARM=emulator");
    }
    is_skipped
}

/// The simulated servo line echoes every byte, like a single wire. On a busy machine an echo may be late.
#[test]
fn a_thousand_echoes_test_the_servo_line() {
    if is_skipped() {
        return;
    }
    let mut image = SelfTest::start(&["--fault", "bus=echo"]);
    for _ in 0..20 {
        let echoes = image.command(b'b', "b: ");
        if image.line("b: ") == "b: passed" {
            assert!(echoes.starts_with("b: 1000 echoes right, 0 wrong, 0 missing, "), "{echoes}");
            check_one_servo(&mut image);
            return;
        }
    }
    panic!("step b does not pass");
}

/// Runs the steps in the order that is used with a board.
#[test]
fn each_step_reports_its_results_and_none_gives_torque() {
    if is_skipped() {
        return;
    }
    let mut image = SelfTest::start(&[]);
    assert_eq!(image.command(b'a', "a: clock"), "a: clock Emulated, RCC_CSR 00000000, brown-out level 3");
    assert_eq!(image.line("a: VDD"), "a: VDD None mV", "the emulator has no voltage reference");
    assert_eq!(image.line("a: chip id"), "a: chip id 7b0700000001");
    image.line("a: passed");
    image.command(b'b', "b: no echo");
    check_one_servo(&mut image);
    check_seven_servos(&mut image);
    image.command(b'e', "e: p panic");

    image.command(b'p', "self-test, last run ended in Some(Panic)");
    image.line("a: passed");
    image.command(b'h', "self-test, last run ended in Some(HardFault)");
    image.line("a: passed");
    image.command(b'o', "self-test, last run ended in Some(HardFault)");
    image.line("a: passed");
    image.command(b'w', "w: the emulator has no watchdog");

    // The emulator writes the file continuously, a little behind the host link.
    thread::sleep(Duration::from_millis(100));
    let frames = frames(&image.servo_line);
    let (faults, reads): (Vec<_>, Vec<_>) = frames.iter().partition(|frame| frame[4] == SYNC_WRITE);
    let min = ECHO_TRIES + 1 + 102 + 14;
    assert!(reads.len() >= min, "{}: echoes, a search, one servo, seven servos", reads.len());
    assert!(reads.iter().all(|frame| [PING, READ].contains(&frame[4])), "only pings and reads");
    assert_eq!(faults.len(), 3 * REPEATS, "panic, hard fault, stack overflow");
    assert!(faults.iter().all(|frame| frame[..] == DAMPING), "{faults:02x?}");
}
