//! The firmware's log, read from the emulated chip's memory and decoded by defmt-print.
//!
//! ```text
//!   _SEGGER_RTT: │ name: 16 bytes │ channels up, down │ name │ buffer │ size │ written to │ read to │ flags │
//! ```
//!
//! No debugger advances "read to" here, and the firmware writes without waiting for that. If the firmware writes more than the
//! buffer holds between two polls, log entries are lost.

use std::io::Write;
use std::path::Path;
use std::process::{ChildStdin, Command, Stdio};

use object::read::elf::ElfFile32;
use object::{Object, ObjectSymbol};

use crate::monitor::Monitor;
use crate::process::{ChildProcess, TaskResult};

/// The length in bytes of the control block up to the end of its first channel.
const CONTROL_BLOCK: u32 = 48;

/// Copies the log from the chip's memory to the input of defmt-print.
pub(crate) struct Log {
    control_block: u32,
    printed_to: usize,
    /// Declared before `_printer`, so dropped before it: the printer ends when its input is closed.
    input: ChildStdin,
    _printer: ChildProcess,
}

impl Log {
    pub(crate) fn open(image: &Path) -> TaskResult<Self> {
        let printer = Command::new("defmt-print")
            .arg("-e")
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(std::io::stderr())
            .spawn();
        let mut printer = ChildProcess(printer.map_err(|why| {
            format!("cannot start defmt-print ({why}): `cargo install defmt-print --locked` installs it")
        })?);
        let input = printer.0.stdin.take().ok_or("defmt-print has no input")?;
        let control_block = address_of("_SEGGER_RTT", image)?;
        Ok(Self { control_block, printed_to: 0, input, _printer: printer })
    }

    /// Prints what the firmware logged since the last call.
    pub(crate) fn print_new(&mut self, monitor: &mut Monitor) -> TaskResult {
        let block = monitor.memory(self.control_block, CONTROL_BLOCK)?;
        let field = |at: usize| {
            let bytes = block.get(at..).and_then(|rest| rest.first_chunk()).copied();
            bytes.map(u32::from_le_bytes).ok_or("the control block of the log is incomplete")
        };
        let (buffer, size, written_to) = (field(28)?, field(32)?, field(36)? as usize);
        if written_to == self.printed_to || size == 0 {
            return Ok(());
        }
        let ring = monitor.memory(buffer, size)?;
        let (start, end) = (self.printed_to, written_to);
        let new =
            if start <= end { ring.get(start..end).map(<[u8]>::to_vec) } else { wrapped(&ring, start, end) };
        self.printed_to = end;
        self.input.write_all(&new.ok_or("the control block of the log is invalid")?)?;
        Ok(self.input.flush()?)
    }
}

fn wrapped(ring: &[u8], start: usize, end: usize) -> Option<Vec<u8>> {
    Some([ring.get(start..)?, ring.get(..end)?].concat())
}

fn address_of(name: &str, image: &Path) -> TaskResult<u32> {
    let file = std::fs::read(image)?;
    let elf: ElfFile32<'_> = ElfFile32::parse(file.as_slice())?;
    let symbol = elf.symbols().find(|symbol| symbol.name() == Ok(name));
    let address = symbol.ok_or_else(|| format!("{} has no {name}", image.display()))?.address();
    Ok(u32::try_from(address)?)
}
