//! Switches the emulator's log of executed instructions on and off, and parses the log.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;

use tempfile::TempDir;

use crate::monitor::Monitor;
use crate::process::TaskResult;
use crate::trace::{self, TraceEvent};

pub(crate) struct InstructionLog {
    path: PathBuf,
    begin: u64,
}

impl InstructionLog {
    /// The log of the emulator whose files are in `folder`. The log is off.
    pub(crate) fn new(folder: &TempDir) -> Self {
        Self { path: folder.path().join("log"), begin: 0 }
    }

    /// The options of the emulator for the log. `clock` is the value of `-icount`.
    pub(crate) fn options(&self, clock: &str) -> [String; 5] {
        ["-icount", clock, "-singlestep", "-D", &self.path.display().to_string()].map(str::to_owned)
    }

    pub(crate) fn begin(&mut self, monitor: &mut Monitor) -> TaskResult {
        self.begin = fs::metadata(&self.path).map_or(0, |log| log.len());
        monitor.human("log exec,nochain")
    }

    /// Switches the log off, empties the file, and returns the events since `begin`.
    pub(crate) fn end(&self, monitor: &mut Monitor) -> TaskResult<Vec<TraceEvent>> {
        monitor.human("log none")?;
        let mut file = File::options().read(true).write(true).open(&self.path)?;
        file.seek(SeekFrom::Start(self.begin))?;
        let mut text = String::new();
        file.read_to_string(&mut text)?;
        // If the emulator continues to write at its old position, the file becomes sparse: large, but without blocks on the disk.
        file.set_len(0)?;
        Ok(trace::parse(&text))
    }
}
