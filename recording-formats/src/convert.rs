//! Converts a recording, and keeps the messages that the new format can hold.

use std::io::{Read, Write};

use mcap::write::NoSeek;
use sevenbot::recording::Recording;

use crate::format::Format;
use crate::read::read_and_pass_on;
use crate::read_error::ReadError;
use crate::write::write;
use crate::writer::{io_error, options};

/// Reads a recording, and writes it in a format. From MCAP to MCAP all messages are copied, also of other topics, and a file
/// that is cut off gets an end and an index.
///
/// # Errors
/// The errors of [`crate::read`], or the output cannot be written. With [`ReadError::Damaged`], the readable part was written.
pub fn convert(source: impl Read, format: Format, mut out: impl Write) -> Result<Recording, ReadError> {
    let mut copy = Vec::new();
    let mut writer = options().create(NoSeek::new(&mut copy)).map_err(io_error)?;
    let mut has_messages = false;
    let read = read_and_pass_on(source, |message| {
        has_messages = true;
        if format == Format::Mcap { writer.write(message).map_err(io_error) } else { Ok(()) }
    });
    let recording = match &read {
        Ok(recording) | Err(ReadError::Damaged { readable: recording, .. }) => recording,
        Err(_) => return read,
    };
    match format {
        Format::Mcap if has_messages => {
            writer.finish().map_err(io_error)?;
            drop(writer);
            out.write_all(&copy)?;
        }
        other => write(recording, other, out)?,
    }
    read
}
