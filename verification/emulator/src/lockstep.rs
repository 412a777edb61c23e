//! Runs the image in the emulator in virtual time, with its simulated servos in this process.
//!
//! ```text
//!   the image is about to sleep ──▶ stop: take what it sent, give it at most one byte per line ──▶ go on
//! ```
//!
//! Virtual time stands still during a stop, so the time that this process needs does not count. An instruction takes 8 ns. The
//! image sleeps in real time: a busy computer may end a sleep late, and then a tick is late or lost. A byte arrives only
//! at a stop, so the first byte of a frame is up to one tick, 1 ms, late. The next bytes arrive one per stop, each with its
//! own interrupt.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;

use arm_sim::servo_bus::ServoBus;
use linked_image::Effect;
use linked_image::Program;
use protocol_core::time::Instant;

use crate::chip_program::IMAGE;
use crate::debugger::Debugger;
use crate::instruction_log::InstructionLog;
use crate::machine::Machine;
use crate::process::TaskResult;
use crate::trace::TraceEvent;

/// The address of TIM2_CNT, the clock of the image, in microseconds.
const CLOCK: u32 = 0x4000_0024;
/// The addresses of the status registers of the USARTs of host link and servo bus (RM0090, section 30.6.1).
const HOST_STATUS: u32 = 0x4001_1000;
const SERVO_STATUS: u32 = 0x4000_4400;
/// Bit RXNE of a status register: a received byte waits in the USART.
const RXNE: u32 = 1 << 5;

/// The image, its lines and its servos.
pub struct Lockstep<B> {
    /// The simulated servos behind the servo bus.
    pub bus: B,
    debugger: Debugger,
    machine: Machine,
    log: InstructionLog,
    host: ImageLine,
    servos: ImageLine,
    sent_to_servos: usize,
    now: Instant,
}

/// Numbers of bytes that the image has sent.
pub struct Sent {
    /// On the host link, USART1.
    pub to_host: usize,
    /// On the servo bus, USART2.
    pub to_servos: usize,
}

/// One serial line of the image.
struct ImageLine {
    stream: UnixStream,
    status: u32,
    to_image: VecDeque<u8>,
}

impl<B: ServoBus> Lockstep<B> {
    /// Starts the image with `bus`, and runs it until it sleeps for the first time.
    pub fn start(bus: B) -> TaskResult<Self> {
        let folder = tempfile::tempdir()?;
        let log = InstructionLog::new(&folder);
        let options = log.options("shift=3,sleep=on");
        let options: Vec<_> = options.iter().map(String::as_str).chain(["-S"]).collect();
        let (machine, servos) = Machine::start_with_bus(folder, &options)?;
        let host = ImageLine::new(machine.host.try_clone()?, HOST_STATUS)?;
        let servos = ImageLine::new(servos, SERVO_STATUS)?;
        let mut debugger = machine.debugger()?;
        let file = IMAGE.read()?;
        let program = Program::read(&file)?;
        for sleep in program.addresses_of(Effect::WaitForInterrupt) {
            // Break one instruction earlier, because the debugger cannot step over a sleep.
            let before = program.instruction_before(sleep).ok_or("nothing precedes a sleep")?;
            debugger.break_at(before)?;
        }
        debugger.run()?;
        let now = Instant::ZERO;
        Ok(Self { bus, debugger, machine, log, host, servos, sent_to_servos: 0, now })
    }

    /// Queues bytes for the host link of the image. Each stop delivers one of them.
    pub fn host_send(&mut self, bytes: &[u8]) {
        self.host.to_image.extend(bytes);
    }

    /// How many bytes the image has sent since the last call.
    pub fn take_sent(&mut self) -> TaskResult<Sent> {
        let to_host = self.host.received()?.len();
        Ok(Sent { to_host, to_servos: std::mem::take(&mut self.sent_to_servos) })
    }

    /// Runs the image until it sleeps at `until` or later, and returns the instructions that it executes.
    pub fn log_until(&mut self, until: Instant) -> TaskResult<Vec<TraceEvent>> {
        self.log.begin(&mut self.machine.monitor)?;
        self.advance(until)?;
        self.log.end(&mut self.machine.monitor)
    }

    /// Runs the image until it sleeps at `until` or later.
    pub fn advance(&mut self, until: Instant) -> TaskResult {
        while self.now < until {
            self.host.give_byte(&mut self.debugger)?;
            self.servos.give_byte(&mut self.debugger)?;
            self.debugger.step()?;
            self.debugger.run()?;
            self.now = Instant::from_micros(self.debugger.word(CLOCK)?.into());
            let sent = self.servos.received()?;
            if !sent.is_empty() {
                self.sent_to_servos += sent.len();
                self.bus.bytes(self.now, &sent);
            }
            self.servos.to_image.extend(self.bus.poll(self.now));
        }
        Ok(())
    }
}

impl ImageLine {
    fn new(stream: UnixStream, status: u32) -> TaskResult<Self> {
        stream.set_nonblocking(true)?;
        Ok(Self { stream, status, to_image: VecDeque::new() })
    }

    /// Gives the image the next byte, and waits until it is in the USART.
    fn give_byte(&mut self, debugger: &mut Debugger) -> TaskResult {
        let Some(byte) = self.to_image.pop_front() else { return Ok(()) };
        self.stream.write_all(&[byte])?;
        wait_for_bit(debugger, self.status)
    }

    fn received(&mut self) -> TaskResult<Vec<u8>> {
        let mut bytes = vec![0; 4_096];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err("the emulator has ended")?,
            Ok(count) => bytes.truncate(count),
            Err(error) if error.kind() == ErrorKind::WouldBlock => bytes.clear(),
            Err(error) => Err(error)?,
        }
        Ok(bytes)
    }
}

fn wait_for_bit(debugger: &mut Debugger, status: u32) -> TaskResult {
    while debugger.word(status)? & RXNE == 0 {}
    Ok(())
}
