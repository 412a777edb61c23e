//! A client of the emulator's monitor (QMP). Each command, reply and event is one line of JSON.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

use crate::process::{TIMEOUT, TaskResult, wait_for};

/// Waits until the emulator connects.
pub fn accept(listener: &UnixListener) -> TaskResult<UnixStream> {
    listener.set_nonblocking(true)?;
    let (stream, _) = wait_for("the emulator connects", || Ok(listener.accept().ok()))?;
    stream.set_nonblocking(false)?;
    Ok(stream)
}

/// A connection to the emulator's monitor, which speaks QMP.
pub struct Monitor {
    stream: BufReader<UnixStream>,
    /// The file into which the emulator writes memory for [`Self::memory`].
    scratch: PathBuf,
}

impl Monitor {
    /// Opens the monitor on `stream`, with a file in `folder`.
    pub fn new(stream: UnixStream, folder: &Path) -> TaskResult<Self> {
        stream.set_read_timeout(Some(TIMEOUT))?;
        let mut monitor = Self { stream: BufReader::new(stream), scratch: folder.join("memory") };
        monitor.execute("qmp_capabilities", "")?;
        Ok(monitor)
    }

    /// Executes a command; `arguments` are the members of a JSON object, without its braces.
    pub fn execute(&mut self, command: &str, arguments: &str) -> TaskResult {
        writeln!(self.stream.get_mut(), r#"{{"execute":"{command}","arguments":{{{arguments}}}}}"#)?;
        loop {
            let mut line = String::new();
            if self.stream.read_line(&mut line)? == 0 {
                Err("the emulator has ended")?;
            }
            if line.starts_with(r#"{"return""#) {
                return Ok(());
            }
            if line.starts_with(r#"{"error""#) {
                Err(format!("the emulator refuses {command}: {}", line.trim_end()))?;
            }
        }
    }

    /// Executes a command of QEMU's human monitor.
    pub fn human(&mut self, line: &str) -> TaskResult {
        self.execute("human-monitor-command", &format!(r#""command-line":"{line}""#))
    }

    /// `length` bytes of the chip's memory from `address` on.
    pub fn memory(&mut self, address: u32, length: u32) -> TaskResult<Vec<u8>> {
        let file = self.scratch.display().to_string();
        self.execute("pmemsave", &format!(r#""val":{address},"size":{length},"filename":"{file}""#))?;
        Ok(fs::read(&self.scratch)?)
    }

    /// Waits until the bits of `mask` are set in the register at `address`.
    pub fn wait_for_bits(&mut self, address: u32, mask: u32) -> TaskResult {
        wait_for("the firmware opens its host link", || {
            let bytes = self.memory(address, 4)?;
            let is_set = bytes.try_into().map(u32::from_le_bytes).is_ok_and(|value| value & mask == mask);
            Ok(is_set.then_some(()))
        })
    }
}
