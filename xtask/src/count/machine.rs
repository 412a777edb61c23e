//! The image under observation: in the emulator, one instruction at a time, with a log that can be switched on and
//! off. Time there goes by instructions, so however slow the log is, the arm does not notice.

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

use super::trace::{self, Event};
use crate::emulate;
use crate::emulate::monitor::{self, Monitor};
use crate::run::{IMAGE, Outcome, Running};

/// How long a reply may take, on a machine that does other things too.
const PATIENCE: Duration = Duration::from_secs(60);
/// Time enough for the arm to have done what it was told and to sleep again.
const CALM: Duration = Duration::from_millis(20);

/// The arm in the emulator.
pub(crate) struct Machine {
    monitor: Monitor,
    host: UnixStream,
    log: PathBuf,
    // In this order: the emulator ends before what is on its lines, and that before the sockets.
    _machine: Running,
    _servos: Option<Running>,
    _folder: TempDir,
}

impl Machine {
    /// Starts the image with seven servos, and waits until its arm is in position.
    pub(crate) fn with_servos() -> Outcome<Self> {
        let folder = tempfile::tempdir()?;
        let servos = emulate::start_servos(&folder, &[])?;
        let bus = emulate::servo_socket(&folder);
        let mut machine = Self::start(folder, Some(servos), &bus, "shift=0,sleep=on")?;
        // Twice: before the servos are looked at, none is known to be missing.
        for _ in 0..2 {
            sleep(Duration::from_secs(1));
            while machine.read(MISSING_SERVOS.address, 1)? != [0] {
                sleep(CALM);
            }
        }
        Ok(machine)
    }

    /// Starts the image with nobody on its lines. Nothing waits for real time then: what it does is the same in
    /// every run, to the instruction.
    pub(crate) fn alone() -> Outcome<Self> {
        Self::start(tempfile::tempdir()?, None, "null", "shift=0,sleep=off")
    }

    fn start(folder: TempDir, servos: Option<Running>, bus: &str, icount: &str) -> Outcome<Self> {
        let host = UnixListener::bind(folder.path().join("host"))?;
        let commands = UnixListener::bind(folder.path().join("monitor"))?;
        let log = folder.path().join("log");
        let log_option = log.display().to_string();
        let options = ["-icount", icount, "-singlestep", "-D", &log_option];
        let machine = emulate::start_machine(&IMAGE, &folder, bus, &options)?;
        let host = monitor::accept(&host)?;
        host.set_read_timeout(Some(PATIENCE))?;
        let mut monitor = Monitor::new(monitor::accept(&commands)?, folder.path())?;
        monitor.wait_for_bits(emulate::HOST_LINK_CONTROL, emulate::RECEIVER_ON)?;
        Ok(Self { monitor, host, log, _machine: machine, _servos: servos, _folder: folder })
    }

    /// Sends bytes to the arm, and lets it get calm.
    pub(crate) fn send(&mut self, bytes: &[u8]) -> Outcome {
        self.host.write_all(bytes)?;
        sleep(CALM);
        Ok(())
    }

    /// Waits for a reply with this many values.
    pub(crate) fn reply(&mut self, count: u8) -> Outcome<Vec<u8>> {
        let mut reply = vec![0; 7 + usize::from(count)];
        self.host.read_exact(&mut reply).map_err(|why| format!("the arm does not answer: {why}"))?;
        Ok(reply.get(5..5 + usize::from(count)).unwrap_or_default().to_vec())
    }

    /// Reads registers over the wire.
    pub(crate) fn read(&mut self, address: u8, count: u8) -> Outcome<Vec<u8>> {
        self.host.write_all(&frame(Request::Read { address, count }))?;
        self.reply(count)
    }

    /// Waits until the arm has answered all that it was asked, and forgets the answers.
    pub(crate) fn settle(&mut self) -> Outcome {
        self.host.write_all(&frame(Request::Read { address: 0, count: 0 }))?;
        loop {
            let mut head = [0; 5];
            self.host.read_exact(&mut head).map_err(|why| format!("the arm does not answer: {why}"))?;
            let [.., count] = head;
            self.host.read_exact(&mut vec![0; usize::from(count) + 2])?;
            // Answers keep the order of their requests (D5), and only this one is empty.
            if count == 0 {
                return Ok(());
            }
        }
    }

    /// Logs what the arm executes meanwhile.
    pub(crate) fn watch(&mut self, act: impl FnOnce(&mut Self) -> Outcome) -> Outcome<Vec<Event>> {
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

    fn command(&mut self, line: &str) -> Outcome {
        self.monitor.execute("human-monitor-command", &format!(r#""command-line":"{line}""#))
    }
}

/// A request as it goes on the wire.
pub(crate) fn frame(request: Request<'_>) -> Vec<u8> {
    let mut buffer = FrameBuffer::new();
    request.encode(&mut buffer);
    buffer.to_vec()
}
