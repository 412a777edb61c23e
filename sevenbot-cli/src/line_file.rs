//! A file that contains whole lines only, also after an error such as a full disk.

use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use crate::command_error::CommandError;
use crate::output_file::OutputFile;

/// A file for appending lines.
pub(crate) struct LineFile {
    path: PathBuf,
    file: File,
}

impl LineFile {
    /// Empties the file.
    pub(crate) fn begin(output: OutputFile) -> Result<Self, CommandError> {
        let path = output.path().to_owned();
        Ok(Self { file: output.begin()?, path })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
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
