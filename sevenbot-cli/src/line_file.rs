//! A file that always contains whole lines, even after an error such as a full disk.

use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use crate::command_error::CommandError;

/// A file for appending lines.
pub(crate) struct LineFile {
    path: PathBuf,
    file: File,
}

impl LineFile {
    /// Creates the file, or empties it.
    pub(crate) fn create(path: &Path) -> Result<Self, CommandError> {
        let file = File::create(path).map_err(|error| CommandError::file(path, error))?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Appends whole lines, or nothing.
    pub(crate) fn add(&mut self, lines: &str) -> Result<(), CommandError> {
        self.write(lines).map_err(|error| CommandError::file(&self.path, error))
    }

    fn write(&mut self, lines: &str) -> io::Result<()> {
        // Remove a partial write, except in a pipe, which has no position.
        let end = self.file.stream_position();
        let written = self.file.write_all(lines.as_bytes());
        if let (Err(_), Ok(end)) = (&written, end) {
            self.file.set_len(end)?;
        }
        written
    }
}
