//! A file that grows by whole lines, however it ends: neither a pulled cable nor a full disk leaves half a line.
//!
//! Knows nothing of what the lines say.

use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use crate::command_error::CommandError;

/// A file to which lines are added.
pub(crate) struct LineFile {
    path: PathBuf,
    file: File,
}

impl LineFile {
    /// An empty file; what was in it is gone.
    pub(crate) fn create(path: &Path) -> Result<Self, CommandError> {
        let file = File::create(path).map_err(|error| CommandError::file(path, error))?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Adds whole lines, or nothing.
    pub(crate) fn add(&mut self, lines: &str) -> Result<(), CommandError> {
        self.write(lines).map_err(|error| CommandError::file(&self.path, error))
    }

    fn write(&mut self, lines: &str) -> io::Result<()> {
        // A pipe has no position; nothing can be taken back there.
        let end = self.file.stream_position();
        let written = self.file.write_all(lines.as_bytes());
        if let (Err(_), Ok(end)) = (&written, end) {
            self.file.set_len(end)?;
        }
        written
    }
}
