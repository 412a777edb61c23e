//! The emulator's monitor (QMP): one line of JSON a command, one line an answer, events in between.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::run::Outcome;

/// How long the emulator may take to start, or to answer.
const PATIENCE: Duration = Duration::from_secs(60);

/// Waits until the emulator, which was told to, connects.
pub(crate) fn accept(listener: &UnixListener) -> Outcome<UnixStream> {
    listener.set_nonblocking(true)?;
    let deadline = Instant::now() + PATIENCE;
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                return Ok(stream);
            }
            Err(why) if Instant::now() > deadline => Err(format!("the emulator did not start ({why})"))?,
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

/// A connection to the monitor.
pub(crate) struct Monitor {
    stream: BufReader<UnixStream>,
    /// The file by which memory is handed over.
    scratch: PathBuf,
}

impl Monitor {
    /// Speaks over `stream`, and keeps a file in `folder`.
    pub(crate) fn new(stream: UnixStream, folder: &Path) -> Outcome<Self> {
        stream.set_read_timeout(Some(PATIENCE))?;
        let mut monitor = Self { stream: BufReader::new(stream), scratch: folder.join("memory") };
        monitor.execute("qmp_capabilities", "")?;
        Ok(monitor)
    }

    /// Executes a command; `arguments` are the members of a JSON object, without its braces.
    pub(crate) fn execute(&mut self, command: &str, arguments: &str) -> Outcome {
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

    /// `length` bytes of the chip's memory from `address` on.
    pub(crate) fn memory(&mut self, address: u32, length: u32) -> Outcome<Vec<u8>> {
        let file = self.scratch.display().to_string();
        self.execute("pmemsave", &format!(r#""val":{address},"size":{length},"filename":"{file}""#))?;
        Ok(fs::read(&self.scratch)?)
    }

    /// Waits until the bits of `mask` are set in the register at `address`.
    pub(crate) fn wait_for_bits(&mut self, address: u32, mask: u32) -> Outcome {
        let deadline = Instant::now() + PATIENCE;
        while Instant::now() < deadline {
            let bytes = self.memory(address, 4)?;
            if bytes.try_into().map(u32::from_le_bytes).is_ok_and(|value| value & mask == mask) {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        Err("the firmware did not open its host link")?
    }
}
