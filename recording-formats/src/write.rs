//! Writes a whole recording in a format.

use std::io::{self, Write};

use sevenbot::recording::{FileVersion, Recording, head};

use crate::csv;
use crate::format::Format;
use crate::telemetry::Telemetry;
use crate::writer::{McapLayout, McapWriter};

/// Writes a recording. In MCAP its time begins in 1970, because a [`Recording`] has no date.
///
/// # Errors
/// The output cannot be written.
pub fn write(recording: &Recording, format: Format, mut out: impl Write) -> io::Result<()> {
    match format {
        Format::Text => out.write_all(text(recording).as_bytes()),
        Format::Csv => out.write_all(csv::text(recording).as_bytes()),
        Format::Mcap => {
            let mut writer = McapWriter::new(out, McapLayout::Indexed)?;
            for moment in recording.moments() {
                writer.add(moment.time, &moment, &Telemetry::default())?;
            }
            writer.finish()
        }
    }
}

fn text(recording: &Recording) -> String {
    let lines = recording.moments().map(|moment| moment.line(FileVersion::Hundredths) + "\n");
    std::iter::once(head(FileVersion::Hundredths)).chain(lines).collect()
}
