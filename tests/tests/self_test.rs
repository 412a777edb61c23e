//! The image for the first power-up of a board, in the emulator, as far as it goes there: what each step says on the
//! host link, and what has left the servo line in the end. The log says the same as the host link.
//!
//! Runs with `ARM=emulator`: there is nothing of it in the simulator.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use std::{env, fs, thread};

use rustix::process::{Pid, Signal, kill_process};
use serialport::SerialPort;
use system_tests::line::PATIENCE;
use system_tests::programs::xtask;
use tempfile::TempDir;

/// Instructions to servos (hardware of the SCS series): ping, read, sync write.
const PING: u8 = 0x01;
const READ: u8 = 0x02;
const SYNC_WRITE: u8 = 0x83;
/// A fault sets the torque switch (register 40) of seven servos to 0, damping, three times.
const DAMPING: [u8; 22] = [0xFF, 0xFF, 0xFE, 18, 0x83, 40, 1, 0, 0, 1, 0, 2, 0, 3, 0, 4, 0, 5, 0, 6, 0, 0x2E];
const REPEATS: usize = 3;
/// After so many frames without an echo there is none.
const ECHOES_TRIED: usize = 20;

/// The image in an emulator, and a line to it.
struct PowerUp {
    process: Child,
    port: Box<dyn SerialPort>,
    heard: String,
    servo_line: PathBuf,
    _folder: TempDir,
}

impl PowerUp {
    /// Starts it, with more options for the emulator.
    fn start(options: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let servo_line = folder.path().join("servo-line");
        let mut process = Command::new(xtask())
            .args(["emulate", "--no-build", "--self-test", "--servo-line"])
            .arg(&servo_line)
            .args(options)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the emulator starts");
        let mut ready = String::new();
        let output = process.stdout.take().expect("a pipe");
        BufReader::new(output).read_line(&mut ready).expect("a line");
        let path = ready.trim_end().strip_prefix("ready ").expect("the name of the port").to_owned();
        let port = serialport::new(path, 115_200).timeout(Duration::from_millis(100)).open();
        let port = port.expect("the port opens");
        Self { process, port, heard: String::new(), servo_line, _folder: folder }
    }

    /// Sends a command and waits for a line that begins so; gives the whole line.
    fn command(&mut self, letter: u8, beginning: &str) -> String {
        self.port.write_all(&[letter]).expect("the port takes bytes");
        self.line(beginning)
    }

    /// Waits for a line that begins so; what comes before it is forgotten.
    fn line(&mut self, beginning: &str) -> String {
        let deadline = Instant::now() + PATIENCE;
        loop {
            while let Some((line, rest)) = self.heard.split_once("\r\n") {
                let (line, rest) = (line.to_owned(), rest.to_owned());
                self.heard = rest;
                if line.starts_with(beginning) {
                    return line;
                }
            }
            assert!(Instant::now() < deadline, "no line {beginning:?}, but {:?}", self.heard);
            let mut bytes = [0; 256];
            let count = self.port.read(&mut bytes).unwrap_or(0);
            self.heard.push_str(&String::from_utf8_lossy(&bytes[..count]));
        }
    }
}

impl Drop for PowerUp {
    fn drop(&mut self) {
        if let Some(id) = i32::try_from(self.process.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process(id, Signal::TERM);
        }
        let _ = self.process.wait();
    }
}

/// The frames in a file, from header to checksum; it has to hold nothing else.
fn frames(path: &Path) -> Vec<Vec<u8>> {
    let bytes = fs::read(path).expect("what the image sent");
    let mut rest = bytes.as_slice();
    let mut frames = Vec::new();
    while let [0xFF, 0xFF, _, length, ..] = *rest {
        let (frame, after) = rest.split_at(4 + usize::from(length));
        let sum = frame[2..].iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        assert_eq!(sum, 0xFF, "checksum of {frame:02x?}");
        frames.push(frame.to_vec());
        rest = after;
    }
    assert!(rest.is_empty(), "no frame: {rest:02x?}");
    frames
}

/// On a busy machine an answer may come too late, and simulated servos are not ready at once: so this is tried again.
fn one_servo(image: &mut PowerUp) {
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
    panic!("step c has never passed");
}

/// Likewise; this step goes on by itself until the next command.
fn seven_servos(image: &mut PowerUp) {
    let mut poses = image.command(b'd', "d: counts");
    for _ in 0..20 {
        if image.line("d: ") == "d: passed" {
            assert!(!poses.contains("-1"), "{poses}");
            assert!(poses.ends_with("torque switches [0, 0, 0, 0, 0, 0, 0]"), "{poses}");
            return;
        }
        poses = image.line("d: counts");
    }
    panic!("step d has never passed");
}

/// Not chosen: the simulator has nothing of it.
fn is_left_out() -> bool {
    let is_left_out = env::var_os("ARM").is_none_or(|arm| arm != "emulator");
    if is_left_out {
        eprintln!("skipped self_test: the image for the first power-up runs with ARM=emulator");
    }
    is_left_out
}

/// The simulated servo line gives back every byte, as one wire does. On a busy machine one may come too late.
#[test]
fn a_thousand_echoes_prove_the_servo_line() {
    if is_left_out() {
        return;
    }
    let mut image = PowerUp::start(&["--fault", "bus=echo"]);
    for _ in 0..20 {
        let echoes = image.command(b'b', "b: ");
        if image.line("b: ") == "b: passed" {
            assert!(echoes.starts_with("b: 1000 echoes right, 0 wrong, 0 missing, "), "{echoes}");
            one_servo(&mut image);
            return;
        }
    }
    panic!("step b has never passed");
}

/// One after another, as the steps are taken on a board.
#[test]
fn each_step_of_the_first_power_up_says_what_it_finds_and_none_can_give_torque() {
    if is_left_out() {
        return;
    }
    let mut image = PowerUp::start(&[]);
    assert_eq!(image.command(b'a', "a: clock"), "a: clock Emulated, RCC_CSR 00000000, brown-out level 3");
    assert_eq!(image.line("a: VDD"), "a: VDD None mV", "the emulator has no reference to measure");
    assert_eq!(image.line("a: chip id"), "a: chip id 7b0700000001");
    image.line("a: passed");
    image.command(b'b', "b: no echo");
    one_servo(&mut image);
    seven_servos(&mut image);
    image.command(b'e', "e: p panic");

    image.command(b'p', "self-test, last run ended in Some(Panic)");
    image.line("a: passed");
    image.command(b'h', "self-test, last run ended in Some(HardFault)");
    image.line("a: passed");
    image.command(b'o', "self-test, last run ended in Some(HardFault)");
    image.line("a: passed");
    image.command(b'w', "w: the emulator has no watchdog");

    // The emulator writes as it goes; what is asked last is in the file when its answer is here.
    thread::sleep(Duration::from_millis(100));
    let frames = frames(&image.servo_line);
    let (faults, questions): (Vec<_>, Vec<_>) = frames.iter().partition(|frame| frame[4] == SYNC_WRITE);
    let least = ECHOES_TRIED + 1 + 102 + 14;
    assert!(questions.len() >= least, "{}: echoes, a search, one servo, seven servos", questions.len());
    assert!(questions.iter().all(|frame| [PING, READ].contains(&frame[4])), "only questions");
    assert_eq!(faults.len(), 3 * REPEATS, "panic, hard fault, stack overflow");
    assert!(faults.iter().all(|frame| frame[..] == DAMPING), "{faults:02x?}");
}
