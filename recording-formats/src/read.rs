//! Reads a recording in any format. The first bytes determine the format.
//!
//! The length of a text is bounded, so that a wrong path, such as a device, does not fill the memory.

use std::io::{self, Read};

use mcap::Message;
use sevenbot::recording::{Recording, RecordingError};

use crate::read_error::{LONGEST_TEXT, ReadError};
use crate::{csv, mcap_reader};

/// This many bytes of a text are checked before the rest is read.
const START: u64 = 64 * 1_024;

/// Reads a recording: text, CSV or MCAP.
///
/// ```
/// let csv = "seconds,joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,joint_7,vacuum\n0,90,90,65,90,90,90,80,0\n";
/// let recording = recording_formats::read(csv.as_bytes())?;
/// assert_eq!(recording.moments().count(), 1);
/// # Ok::<(), recording_formats::ReadError>(())
/// ```
///
/// # Errors
/// The source cannot be read, or is not a whole recording. [`ReadError::Damaged`] contains the part that can be read.
pub fn read(source: impl Read) -> Result<Recording, ReadError> {
    read_and_pass_on(source, |_| Ok(()))
}

/// As [`read`], and passes on each message of an MCAP file.
pub(crate) fn read_and_pass_on(
    mut source: impl Read,
    pass_on: impl FnMut(&Message) -> io::Result<()>,
) -> Result<Recording, ReadError> {
    let mut bytes = Vec::new();
    source.by_ref().take(START).read_to_end(&mut bytes)?;
    if bytes.starts_with(mcap::MAGIC) {
        return mcap_reader::read(bytes.as_slice().chain(source), pass_on);
    }
    if length(&bytes) == START && !is_recording(&bytes) {
        return Err(RecordingError::NotARecording.into());
    }
    source.take(LONGEST_TEXT - length(&bytes)).read_to_end(&mut bytes)?;
    if length(&bytes) >= LONGEST_TEXT {
        return Err(ReadError::TooLong);
    }
    Ok(parse(&String::from_utf8(bytes).map_err(|_| ReadError::NotText)?)?)
}

fn parse(text: &str) -> Result<Recording, RecordingError> {
    if text.lines().next().is_some_and(csv::is_head) { csv::parse(text) } else { Recording::parse(text) }
}

/// Can a long text with this start be a recording?
fn is_recording(start: &[u8]) -> bool {
    let Some(end) = start.iter().rposition(|&byte| byte == b'\n') else { return false };
    let lines = String::from_utf8_lossy(start.get(..end).unwrap_or_default());
    parse(&lines) != Err(RecordingError::NotARecording)
}

fn length(bytes: &[u8]) -> u64 {
    u64::try_from(bytes.len()).unwrap_or(u64::MAX)
}
