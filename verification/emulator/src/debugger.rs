//! A client of the emulator's debugger interface: the commands of GDB's remote serial protocol that this crate needs.
//!
//! ```text
//!   $data#checksum      both directions; the other end acknowledges with +
//! ```

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

use crate::process::{TIMEOUT, TaskResult, wait_for};

/// A connection to an emulator. The chip is stopped between the commands of the debugger.
pub struct Debugger {
    stream: UnixStream,
    received: Vec<u8>,
}

impl Debugger {
    /// Connects to the emulator's debugger socket. The connection stops the chip.
    ///
    /// # Errors
    /// The socket does not open within [`TIMEOUT`].
    pub fn connect(socket: &Path) -> TaskResult<Self> {
        let stream =
            wait_for("the emulator opens its debugger socket", || Ok(UnixStream::connect(socket).ok()))?;
        stream.set_read_timeout(Some(TIMEOUT))?;
        Ok(Self { stream, received: Vec::new() })
    }

    /// Sets a breakpoint at an instruction.
    pub(crate) fn break_at(&mut self, address: u64) -> TaskResult {
        match self.execute(&format!("Z0,{address:x},2"))?.as_str() {
            "OK" => Ok(()),
            other => Err(format!("the emulator refuses a breakpoint: {other}"))?,
        }
    }

    /// Executes the instruction at which the chip is stopped.
    pub(crate) fn step(&mut self) -> TaskResult {
        self.execute("s").map(|_| ())
    }

    /// Runs the chip until it reaches a breakpoint. If the chip stands at a breakpoint, call [`Self::step`] first.
    pub(crate) fn run(&mut self) -> TaskResult {
        self.execute("c").map(|_| ())
    }

    /// A word of the chip's memory or of a peripheral.
    pub(crate) fn word(&mut self, address: u32) -> TaskResult<u32> {
        let reply = self.execute(&format!("m{address:x},4"))?;
        let word = u32::from_str_radix(&reply, 16)?;
        Ok(word.swap_bytes())
    }

    /// Sets the program counter to `address`, detaches the debugger, and lets the chip run.
    ///
    /// # Errors
    /// The emulator refuses to set the program counter, does not reply within [`TIMEOUT`], or has ended.
    pub fn continue_at(mut self, address: u32) -> TaskResult {
        self.answer("qSupported")?;
        // The emulator allows writes of registers only to a debugger that has read its description of the chip.
        self.answer("qXfer:features:read:target.xml:0,40")?;
        let reply = self.answer(&format!("Pf={:08x}", address.swap_bytes()))?;
        if reply != "OK" {
            Err(format!("the emulator does not set the program counter: {reply}"))?;
        }
        self.answer("D").map(drop)
    }

    /// The reply to a command that does not run the chip. The notice that the chip has stopped may arrive before it.
    fn answer(&mut self, command: &str) -> TaskResult<String> {
        let mut reply = self.execute(command)?;
        while reply.starts_with('T') {
            reply = self.next_reply()?;
        }
        Ok(reply)
    }

    fn execute(&mut self, command: &str) -> TaskResult<String> {
        let checksum = command.bytes().fold(0_u8, u8::wrapping_add);
        self.stream.write_all(format!("${command}#{checksum:02x}").as_bytes())?;
        self.next_reply()
    }

    fn next_reply(&mut self) -> TaskResult<String> {
        let mut bytes = [0; 256];
        loop {
            if let Some(reply) = self.take_reply() {
                self.stream.write_all(b"+")?;
                return Ok(reply);
            }
            let count = self.stream.read(&mut bytes)?;
            if count == 0 {
                Err("the emulator has ended")?;
            }
            self.received.extend(bytes.iter().take(count));
        }
    }

    fn take_reply(&mut self) -> Option<String> {
        let start = self.received.iter().position(|&byte| byte == b'$')?;
        let length = self.received.get(start..)?.iter().position(|&byte| byte == b'#')?;
        let end = start + length;
        // Two digits of the checksum follow. They are not checked, because a local socket does not corrupt bytes.
        if self.received.len() < end + 3 {
            return None;
        }
        let reply = String::from_utf8_lossy(self.received.get(start + 1..end)?).into_owned();
        self.received.drain(..end + 3);
        Some(reply)
    }
}
