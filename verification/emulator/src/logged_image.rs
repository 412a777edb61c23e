//! The image in the emulator, one instruction at a time, with an optional log. While the image executes instructions, virtual
//! time depends on their number only, so the log does not affect the arm.

use std::io::{Read, Write};
use std::thread::sleep;
use std::time::Duration;

use protocol_core::registers::map::MISSING_SERVOS;
use protocol_core::request::Request;
use tempfile::TempDir;

use crate::chip_program::IMAGE;
use crate::instruction_log::InstructionLog;
use crate::machine::{Machine, servo_socket};
use crate::process::{ChildProcess, TIMEOUT, TaskResult};
use crate::trace::TraceEvent;
use crate::{frame, start_servos};

/// The time after which the arm has usually processed a request and sleeps.
const IDLE_TIME: Duration = Duration::from_millis(20);
/// The time after which the arm has usually processed a byte and sleeps. It is short, because logging takes time.
const BYTE_TIME: Duration = Duration::from_millis(5);

/// The image, with an optional log.
pub struct LoggedImage {
    machine: Machine,
    log: InstructionLog,
    _servos: Option<ChildProcess>,
}

impl LoggedImage {
    /// Starts the image with seven servos, and waits until all servos answer.
    pub fn with_servos() -> TaskResult<Self> {
        let folder = tempfile::tempdir()?;
        let servos = start_servos(&folder, &[], None)?;
        let bus = servo_socket(&folder);
        let mut image = Self::start(folder, Some(servos), &bus, "shift=0,sleep=on")?;
        // Check twice: the arm reports a servo as missing only after failed reads, so the first check may come too early.
        for _ in 0..2 {
            sleep(Duration::from_secs(1));
            while image.read(MISSING_SERVOS.address, 1)? != [0] {
                sleep(IDLE_TIME);
            }
        }
        Ok(image)
    }

    /// Starts the image without servos. Virtual time does not wait for real time, so until a host sends, every run
    /// executes the same instructions.
    pub fn alone() -> TaskResult<Self> {
        Self::start(tempfile::tempdir()?, None, "null", "shift=0,sleep=off")
    }

    fn start(folder: TempDir, servos: Option<ChildProcess>, bus: &str, clock: &str) -> TaskResult<Self> {
        let log = InstructionLog::new(&folder);
        let options = log.options(clock);
        let mut machine = Machine::start(&IMAGE, folder, bus, &options.each_ref().map(String::as_str))?;
        machine.host.set_read_timeout(Some(TIMEOUT))?;
        machine.wait_for_host_link()?;
        Ok(Self { machine, log, _servos: servos })
    }

    /// Sends bytes to the arm, and waits 20 ms. By then the arm has usually processed them and sleeps.
    pub fn send(&mut self, bytes: &[u8]) -> TaskResult {
        self.machine.host.write_all(bytes)?;
        sleep(IDLE_TIME);
        Ok(())
    }

    /// Sends a byte to the arm, and logs how the arm processes it. On a busy machine the log may end before the arm sleeps.
    pub fn watch_byte(&mut self, byte: u8) -> TaskResult<Vec<TraceEvent>> {
        self.watch(|image| {
            image.machine.host.write_all(&[byte])?;
            sleep(BYTE_TIME);
            Ok(())
        })
    }

    /// Waits for a reply with `count` values, and returns the values.
    pub fn reply(&mut self, count: u8) -> TaskResult<Vec<u8>> {
        let mut reply = vec![0; 7 + usize::from(count)];
        self.machine.host.read_exact(&mut reply).map_err(|why| format!("the arm does not reply: {why}"))?;
        Ok(reply.get(5..5 + usize::from(count)).unwrap_or_default().to_vec())
    }

    /// Reads registers through the host link.
    pub fn read(&mut self, address: u8, count: u8) -> TaskResult<Vec<u8>> {
        self.machine.host.write_all(&frame(Request::Read { address, count }))?;
        self.reply(count)
    }

    /// Sends an empty read, and drops all replies up to its reply.
    pub fn settle(&mut self) -> TaskResult {
        self.machine.host.write_all(&frame(Request::Read { address: 0, count: 0 }))?;
        loop {
            let mut head = [0; 5];
            self.machine
                .host
                .read_exact(&mut head)
                .map_err(|why| format!("the arm does not reply: {why}"))?;
            let [.., count] = head;
            self.machine.host.read_exact(&mut vec![0; usize::from(count) + 2])?;
            // Replies have the order of their requests (D5), and only the reply to this request is empty.
            if count == 0 {
                return Ok(());
            }
        }
    }

    /// Logs the instructions and register accesses during `act`.
    pub fn watch(&mut self, act: impl FnOnce(&mut Self) -> TaskResult) -> TaskResult<Vec<TraceEvent>> {
        self.log_accesses("on")?;
        self.log.begin(&mut self.machine.monitor)?;
        let acted = act(self);
        let events = self.log.end(&mut self.machine.monitor);
        self.log_accesses("off")?;
        acted.and(events)
    }

    /// Switches the log of register accesses on or off. It does not depend on the log of instructions.
    fn log_accesses(&mut self, state: &str) -> TaskResult {
        ["read", "write"].iter().try_for_each(|event| {
            self.machine.monitor.human(&format!("trace-event memory_region_ops_{event} {state}"))
        })
    }
}
