//! Runs the built simulator, with a serial client.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use protocol_core::request::{Reply, Request};
use protocol_core::time;
use protocol_core::wire::{Deframer, FrameBuffer, ToHost, deframer};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, Signal, kill_process};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The time limit of each repeated check: long enough for a slow and busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// A running simulator. Dropping it kills the process.
pub(crate) struct Sim {
    child: Child,
    port: PathBuf,
    stdout: Option<BufReader<ChildStdout>>,
    stderr: Option<ChildStderr>,
    _state: tempfile::TempDir,
}

/// The simulator with these arguments and this state directory.
pub(crate) fn command(state: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.args(arguments).env("XDG_STATE_HOME", state).stdin(Stdio::null());
    command
}

/// The error of a simulator that refuses its arguments: one line, and exit status 2.
pub(crate) fn refused(arguments: &[&str]) -> String {
    complaint(&mut command(tempfile::tempdir().unwrap().path(), arguments))
}

/// Like [`refused`], for a command.
pub(crate) fn complaint(command: &mut Command) -> String {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let status = wait(&mut child);
    let said = read_to_end(&mut child.stderr.take().unwrap());
    assert_eq!(status, Some(2), "{said}");
    assert_eq!(read_to_end(&mut child.stdout.take().unwrap()), "");
    assert_eq!(said.lines().count(), 1, "{said}");
    said
}

/// Waits for the exit status. `None` if the process was killed, for example after the time limit.
fn wait(child: &mut Child) -> Option<i32> {
    let patience_ends = Instant::now() + PATIENCE;
    while Instant::now() < patience_ends {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap().code()
}

impl Sim {
    /// Starts a simulator and waits for its first line.
    pub(crate) fn start(arguments: &[&str]) -> Self {
        let state = tempfile::tempdir().unwrap();
        let child = command(state.path(), arguments);
        Self::spawn(child, state)
    }

    /// Like [`Self::start`], with this state directory.
    pub(crate) fn start_in(state: &Path, arguments: &[&str]) -> Self {
        Self::spawn(command(state, arguments), tempfile::tempdir().unwrap())
    }

    /// Like [`Self::start`], with standard error in a file, so that a long log does not block the process.
    pub(crate) fn start_with_log(arguments: &[&str], log: &Path) -> Self {
        let state = tempfile::tempdir().unwrap();
        let command = command(state.path(), arguments);
        Self::spawn_with_stderr(command, File::create(log).unwrap().into(), state)
    }

    fn spawn(command: Command, state: tempfile::TempDir) -> Self {
        Self::spawn_with_stderr(command, Stdio::piped(), state)
    }

    fn spawn_with_stderr(mut command: Command, stderr: Stdio, state: tempfile::TempDir) -> Self {
        let mut child = command.stdout(Stdio::piped()).stderr(stderr).spawn().unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let stderr = child.stderr.take();
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        let port = line.strip_prefix("ready ").and_then(|rest| rest.strip_suffix('\n'));
        let port = PathBuf::from(port.unwrap_or_else(|| panic!("first line: {line:?}")));
        Self { child, port, stdout: Some(stdout), stderr, _state: state }
    }

    /// The port in the first line.
    pub(crate) fn port(&self) -> &Path {
        &self.port
    }

    pub(crate) fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    /// Sends a signal and waits for the exit status; `None` if the process was killed.
    pub(crate) fn end_with(&mut self, signal: Signal) -> Option<i32> {
        self.signal(signal);
        wait(&mut self.child)
    }

    /// Closes its outputs, as a closed terminal does.
    pub(crate) fn close_output(&mut self) {
        self.stdout = None;
        self.stderr = None;
    }

    /// Its standard output after the first line. The process must have ended.
    pub(crate) fn rest_of_stdout(&mut self) -> String {
        read_to_end(self.stdout.as_mut().unwrap())
    }

    /// Its standard error. The process must have ended.
    pub(crate) fn rest_of_stderr(&mut self) -> String {
        read_to_end(self.stderr.as_mut().unwrap())
    }
}

/// Waits until the condition holds. `what` names it in the error.
#[track_caller]
pub(crate) fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let patience_ends = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < patience_ends, "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn read_to_end(stream: &mut impl Read) -> String {
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

impl Drop for Sim {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A serial client that asks and waits for answers.
pub(crate) struct Client {
    port: File,
    deframer: Deframer<ToHost>,
    /// Received bytes that the deframer has not taken yet.
    received: Vec<u8>,
    start: Instant,
}

impl Client {
    pub(crate) fn open(port: &Path) -> Self {
        let port = OpenOptions::new().read(true).write(true).open(port).unwrap();
        let deframer = Deframer::new(deframer::gap(115_200));
        Self { port, deframer, received: Vec::new(), start: Instant::now() }
    }

    fn send(&mut self, request: Request<'_>) {
        let mut bytes = FrameBuffer::new();
        request.encode(&mut bytes);
        self.port.write_all(&bytes).unwrap();
    }

    pub(crate) fn write(&mut self, address: u8, values: &[u8]) {
        self.send(Request::Write { address, values });
    }

    pub(crate) fn send_read(&mut self, address: u8, count: u8) {
        self.send(Request::Read { address, count });
    }

    /// Reads registers, and waits for the answer.
    pub(crate) fn read(&mut self, address: u8, count: u8) -> Vec<u8> {
        self.send_read(address, count);
        self.answer(address, count)
    }

    /// The next answer from these registers. Other frames and partial frames are skipped.
    pub(crate) fn answer(&mut self, address: u8, count: u8) -> Vec<u8> {
        let patience_ends = Instant::now() + PATIENCE;
        loop {
            while let Some(found) = self.deframer.pull() {
                match found.ok().and_then(Reply::from_frame) {
                    Some(reply) if (reply.address, reply.values.len()) == (address, count.into()) => {
                        return reply.values.to_vec();
                    }
                    _ => {}
                }
            }
            assert!(Instant::now() < patience_ends, "no answer");
            self.receive();
        }
    }

    /// Reads registers repeatedly until they hold these values.
    pub(crate) fn read_until(&mut self, address: u8, values: &[u8]) {
        let patience_ends = Instant::now() + PATIENCE;
        let count = u8::try_from(values.len()).unwrap();
        loop {
            let found = self.read(address, count);
            if found == values {
                return;
            }
            assert!(Instant::now() < patience_ends, "still {found:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Passes bytes to the deframer: the bytes that it has not taken yet, or the next bytes from the port. An empty slice tells
    /// the deframer that the line is idle.
    fn receive(&mut self) {
        if self.received.is_empty() && self.waits_readable() {
            let mut bytes = [0; 4_096];
            let count = self.port.read(&mut bytes).unwrap();
            self.received.extend(&bytes[..count]);
        }
        let micros = u64::try_from(self.start.elapsed().as_micros()).unwrap();
        let taken = self.deframer.push(time::Instant::from_micros(micros), &self.received);
        self.received.drain(..taken);
    }

    fn waits_readable(&self) -> bool {
        let moment = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
        poll(&mut [PollFd::new(&self.port, PollFlags::IN)], Some(&moment)).unwrap() > 0
    }
}

/// A master on a servo bus that sends raw bytes.
pub(crate) struct Bus(File);

impl Bus {
    pub(crate) fn open(port: &Path, baud: u32) -> Self {
        let bus = Self(OpenOptions::new().read(true).write(true).open(port).unwrap());
        bus.set_baud(baud);
        bus
    }

    pub(crate) fn set_baud(&self, baud: u32) {
        let mut mode = tcgetattr(&self.0).unwrap();
        mode.make_raw();
        mode.set_speed(baud).unwrap();
        tcsetattr(&self.0, OptionalActions::Now, &mode).unwrap();
    }

    /// Receives bytes until none has come for this long.
    fn receive(&mut self, quiet: Duration) -> Vec<u8> {
        let mut received = Vec::new();
        let quiet = Timespec { tv_sec: 0, tv_nsec: quiet.as_nanos().try_into().unwrap() };
        while poll(&mut [PollFd::new(&self.0, PollFlags::IN)], Some(&quiet)).unwrap() > 0 {
            let mut bytes = [0; 256];
            let count = self.0.read(&mut bytes).unwrap();
            received.extend(&bytes[..count]);
        }
        received
    }

    /// Sends a frame repeatedly until an answer of this length comes.
    pub(crate) fn ask(&mut self, frame: &[u8], length: usize) -> Vec<u8> {
        let patience_ends = Instant::now() + PATIENCE;
        loop {
            self.0.write_all(frame).unwrap();
            let answer = self.receive(Duration::from_millis(200));
            if answer.len() == length {
                return answer;
            }
            assert!(Instant::now() < patience_ends, "no answer to {frame:02x?} but {answer:02x?}");
        }
    }

    /// Pings a servo once, and receives bytes until none has come for this long.
    pub(crate) fn ping(&mut self, id: u8, quiet: Duration) -> Vec<u8> {
        self.0.write_all(&[0xFF, 0xFF, id, 2, 1, !(id + 3)]).unwrap();
        self.receive(quiet)
    }

    /// Pings a servo until it answers: servos do not answer for a while after power-up.
    pub(crate) fn ping_until_answered(&mut self, id: u8) -> Vec<u8> {
        self.ask(&[0xFF, 0xFF, id, 2, 1, !(id + 3)], 6)
    }
}
