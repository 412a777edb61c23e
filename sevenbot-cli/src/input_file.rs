//! Opens and reads files. The length of a text is bounded, so that a wrong path, such as a device, does not fill the memory.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use recording_formats::ReadError;
use sevenbot::recording::Recording;

use crate::command_error::CommandError;

/// Reads a recording in any format; `-` is standard input.
pub(crate) fn recording(path: &Path) -> Result<Recording, CommandError> {
    recording_formats::read(open(path)?).map_err(|error| match error {
        ReadError::Damaged { .. } => {
            CommandError::file(path, format!("{error}: `sevenbot convert` writes them to a new file"))
        }
        other => CommandError::file(path, other),
    })
}

/// Reads a text that is shorter than `longest` bytes; `-` is standard input.
pub(crate) fn short_text(path: &Path, longest: u64) -> Result<String, CommandError> {
    let mut bytes = Vec::new();
    let read = open(path)?.take(longest).read_to_end(&mut bytes);
    read.map_err(|error| CommandError::file(path, error))?;
    if bytes.len() as u64 >= longest {
        return Err(CommandError::file(
            path,
            format!("this is longer than {longest} bytes: is it the right file?"),
        ));
    }
    String::from_utf8(bytes).map_err(|_| CommandError::file(path, "this is not text in UTF-8"))
}

/// Opens a file; `-` is standard input.
pub(crate) fn open(path: &Path) -> Result<Box<dyn Read>, CommandError> {
    if path.as_os_str() == "-" {
        return Ok(Box::new(io::stdin().lock()));
    }
    let file = File::open(path).map_err(|error| CommandError::file(path, error))?;
    Ok(Box::new(file))
}
