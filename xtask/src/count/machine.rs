//! The image in the emulator, one instruction at a time, with an optional log. Virtual time depends on instructions only, so
//! the log does not affect the arm.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::thread::sleep;
use std::time::Duration;

use protocol_core::registers::map::MISSING_SERVOS;
use protocol_core::request::Request;
use protocol_core::wire::FrameBuffer;
use tempfile::TempDir;

use super::trace::{self, TraceEvent};
use crate::run::{ChildProcess, IMAGE, TIMEOUT, TaskResult};
use emulator::monitor::{self, Monitor};

/// The time after which the arm has processed a request and sleeps.
const IDLE_TIME: Duration = Duration::from_millis(20);
/// The time after which the arm has processed a byte and sleeps, as a rule. What is logged costs time.
const BYTE_TIME: Duration = Duration::from_millis(5);

/// The arm in the emulator.
pub(crate) struct Machine {
    monitor: Monitor,
    host: UnixStream,
    log: PathBuf,
    // In this order: the emulator ends before the processes on its lines, and these before the sockets.
    _machine: ChildProcess,
    _servos: Option<ChildProcess>,
    _folder: TempDir,
}

impl Machine {
    /// Starts the image with seven servos, and waits until its arm is in its pose.
    pub(crate) fn with_servos() -> TaskResult<Self> {
        let folder = tempfile::tempdir()?;
        let servos = emulator::start_servos(&folder, &[], None)?;
        let bus = emulator::servo_socket(&folder);
        let mut machine = Self::start(folder, Some(servos), &bus, "shift=0,sleep=on")?;
        // Twice: before their first read, no servos are reported as missing.
        for _ in 0..2 {
            sleep(Duration::from_secs(1));
            while machine.read(MISSING_SERVOS.address, 1)? != [0] {
                sleep(IDLE_TIME);
            }
        }
        Ok(machine)
    }

    /// Starts the image without connections. Virtual time does not wait for real time, so every run executes the same
    /// instructions.
    pub(crate) fn alone() -> TaskResult<Self> {
        Self::start(tempfile::tempdir()?, None, "null", "shift=0,sleep=off")
    }

    fn start(folder: TempDir, servos: Option<ChildProcess>, bus: &str, icount: &str) -> TaskResult<Self> {
        let host = UnixListener::bind(folder.path().join("host"))?;
        let commands = UnixListener::bind(folder.path().join("monitor"))?;
        let log = folder.path().join("log");
        let log_option = log.display().to_string();
        let options = ["-icount", icount, "-singlestep", "-D", &log_option];
        let machine = emulator::start_machine(&IMAGE, &folder, bus, &options)?;
        let host = monitor::accept(&host)?;
        host.set_read_timeout(Some(TIMEOUT))?;
        let mut monitor = Monitor::new(monitor::accept(&commands)?, folder.path())?;
        monitor.wait_for_bits(emulator::HOST_LINK_CONTROL, emulator::RECEIVER_ON)?;
        Ok(Self { monitor, host, log, _machine: machine, _servos: servos, _folder: folder })
    }

    /// Sends bytes to the arm, and waits until it sleeps.
    pub(crate) fn send(&mut self, bytes: &[u8]) -> TaskResult {
        self.host.write_all(bytes)?;
        sleep(IDLE_TIME);
        Ok(())
    }

    /// Sends a byte to the arm, and logs what it does then. On a busy machine the log may end before the arm sleeps.
    pub(crate) fn watch_byte(&mut self, byte: u8) -> TaskResult<Vec<TraceEvent>> {
        self.watch(|machine| {
            machine.host.write_all(&[byte])?;
            sleep(BYTE_TIME);
            Ok(())
        })
    }

    /// Waits for a reply with this many values.
    pub(crate) fn reply(&mut self, count: u8) -> TaskResult<Vec<u8>> {
        let mut reply = vec![0; 7 + usize::from(count)];
        self.host.read_exact(&mut reply).map_err(|why| format!("the arm does not reply: {why}"))?;
        Ok(reply.get(5..5 + usize::from(count)).unwrap_or_default().to_vec())
    }

    /// Reads registers through the host link.
    pub(crate) fn read(&mut self, address: u8, count: u8) -> TaskResult<Vec<u8>> {
        self.host.write_all(&frame(Request::Read { address, count }))?;
        self.reply(count)
    }

    /// Waits for all pending replies, and drops them.
    pub(crate) fn settle(&mut self) -> TaskResult {
        self.host.write_all(&frame(Request::Read { address: 0, count: 0 }))?;
        loop {
            let mut head = [0; 5];
            self.host.read_exact(&mut head).map_err(|why| format!("the arm does not reply: {why}"))?;
            let [.., count] = head;
            self.host.read_exact(&mut vec![0; usize::from(count) + 2])?;
            // Replies have the order of their requests (D5), and only this one is empty.
            if count == 0 {
                return Ok(());
            }
        }
    }

    /// Logs the instructions and register accesses during `act`.
    pub(crate) fn watch(&mut self, act: impl FnOnce(&mut Self) -> TaskResult) -> TaskResult<Vec<TraceEvent>> {
        let before = fs::metadata(&self.log).map_or(0, |log| log.len());
        for event in ["read", "write"] {
            self.command(&format!("trace-event memory_region_ops_{event} on"))?;
        }
        self.command("log exec,nochain")?;
        let acted = act(self);
        self.command("log none")?;
        acted?;
        let mut file = File::open(&self.log)?;
        file.seek(SeekFrom::Start(before))?;
        let mut log = String::new();
        file.read_to_string(&mut log)?;
        Ok(trace::parse(&log))
    }

    fn command(&mut self, line: &str) -> TaskResult {
        self.monitor.human(line)
    }
}

/// Encodes a request as a frame.
pub(crate) fn frame(request: Request<'_>) -> Vec<u8> {
    let mut buffer = FrameBuffer::new();
    request.encode(&mut buffer);
    buffer.to_vec()
}
