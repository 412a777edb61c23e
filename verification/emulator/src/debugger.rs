//! The emulator's debugger interface: GDB's remote serial protocol, as far as breakpoints need it.
//!
//! ```text
//!   $data#checksum      both directions; the other end acknowledges with +
//! ```

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

use crate::process::{TIMEOUT, TaskResult, wait_for};

/// A connection to an emulator that is stopped.
pub(crate) struct Debugger {
    stream: UnixStream,
    received: Vec<u8>,
}

impl Debugger {
    /// Connects to the socket of an emulator that waits for its debugger.
    pub(crate) fn connect(socket: &Path) -> TaskResult<Self> {
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

    /// Runs until a breakpoint. A chip that is stopped at one has to step first.
    pub(crate) fn run(&mut self) -> TaskResult {
        self.execute("c").map(|_| ())
    }

    /// A word of the chip's memory or of a peripheral.
    pub(crate) fn word(&mut self, address: u32) -> TaskResult<u32> {
        let reply = self.execute(&format!("m{address:x},4"))?;
        let word = u32::from_str_radix(&reply, 16)?;
        Ok(word.swap_bytes())
    }

    fn execute(&mut self, command: &str) -> TaskResult<String> {
        let checksum = command.bytes().fold(0_u8, u8::wrapping_add);
        self.stream.write_all(format!("${command}#{checksum:02x}").as_bytes())?;
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
        // Two digits of the checksum. A local socket damages nothing.
        if self.received.len() < end + 3 {
            return None;
        }
        let reply = String::from_utf8_lossy(self.received.get(start + 1..end)?).into_owned();
        self.received.drain(..end + 3);
        Some(reply)
    }
}
