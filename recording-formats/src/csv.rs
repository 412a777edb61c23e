//! A recording as CSV, for spreadsheets and plot programs: the columns of the text format, with commas and names.
//!
//! ```text
//!   seconds,joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,joint_7,vacuum
//!   0.000,90.00,90.00,65.00,90.00,90.00,90.00,80.00,0
//! ```

use sevenbot::recording::{FileVersion, Recording, RecordingError, head};

/// The names of the columns. Angles are degrees of the arm; vacuum is 1 while the pump sucks.
pub(crate) const COLUMNS: &str = "seconds,joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,joint_7,vacuum";

/// Is this the first line of a recording as CSV?
pub(crate) fn is_head(line: &str) -> bool {
    let names = line.trim_start_matches('\u{feff}').trim().split(',').map(str::trim);
    names.eq(COLUMNS.split(','))
}

/// Parses the lines after the first. Errors have the line numbers of the CSV file.
pub(crate) fn parse(text: &str) -> Result<Recording, RecordingError> {
    let (_, lines) = text.split_once('\n').unwrap_or((text, ""));
    // The first line of the text format replaces the names of the columns, so that the line numbers stay the same.
    let head = head(FileVersion::Hundredths);
    let head = head.lines().next().unwrap_or_default();
    Recording::parse(&format!("{head}\n{}", lines.replace(',', " ")))
}

/// The recording as the text of a CSV file.
pub(crate) fn text(recording: &Recording) -> String {
    let lines = recording.moments().map(|moment| {
        let line = moment.line(FileVersion::Hundredths);
        line.split_whitespace().collect::<Vec<_>>().join(",") + "\n"
    });
    std::iter::once(format!("{COLUMNS}\n")).chain(lines).collect()
}
