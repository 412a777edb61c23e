//! Reads text files of bounded length, so that a wrong path such as a device fills no memory.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use sevenbot::recording::{Recording, RecordingError};

use crate::command_error::CommandError;

/// The start of a recording is checked before the rest is read.
const START: u64 = 64 * 1_024;
/// More than a day of 50 moments a second, in bytes.
const LONGEST_RECORDING: u64 = 512 * 1_024 * 1_024;

/// Reads a recording; `-` is standard input.
pub(crate) fn recording(path: &Path) -> Result<Recording, CommandError> {
    let mut source = open(path)?;
    let mut bytes = Vec::new();
    read_up_to(path, &mut source, START, &mut bytes)?;
    if length(&bytes) == START && !is_recording(&bytes) {
        return Err(CommandError::file(path, RecordingError::NotARecording));
    }
    read_up_to(path, &mut source, LONGEST_RECORDING, &mut bytes)?;
    let recording = Recording::parse(&text(path, bytes, LONGEST_RECORDING)?);
    recording.map_err(|error| CommandError::file(path, error))
}

/// Can a long file with this start be a recording?
fn is_recording(start: &[u8]) -> bool {
    let Some(end) = start.iter().rposition(|&byte| byte == b'\n') else { return false };
    let lines = String::from_utf8_lossy(start.get(..end).unwrap_or_default());
    Recording::parse(&lines) != Err(RecordingError::NotARecording)
}

/// Reads a text that is shorter than `longest` bytes; `-` is standard input.
pub(crate) fn short_text(path: &Path, longest: u64) -> Result<String, CommandError> {
    let mut bytes = Vec::new();
    read_up_to(path, &mut open(path)?, longest, &mut bytes)?;
    text(path, bytes, longest)
}

fn open(path: &Path) -> Result<Box<dyn Read>, CommandError> {
    if path.as_os_str() == "-" {
        return Ok(Box::new(io::stdin().lock()));
    }
    let file = File::open(path).map_err(|error| CommandError::file(path, error))?;
    Ok(Box::new(file))
}

fn read_up_to(
    path: &Path,
    source: &mut dyn Read,
    limit: u64,
    bytes: &mut Vec<u8>,
) -> Result<(), CommandError> {
    let read = source.take(limit.saturating_sub(length(bytes))).read_to_end(bytes);
    read.map(drop).map_err(|error| CommandError::file(path, error))
}

fn length(bytes: &[u8]) -> u64 {
    u64::try_from(bytes.len()).unwrap_or(u64::MAX)
}

fn text(path: &Path, bytes: Vec<u8>, limit: u64) -> Result<String, CommandError> {
    if length(&bytes) >= limit {
        return Err(CommandError::file(
            path,
            format!("this is longer than {limit} bytes: is it the right file?"),
        ));
    }
    String::from_utf8(bytes).map_err(|_| CommandError::file(path, "this is not text in UTF-8"))
}
