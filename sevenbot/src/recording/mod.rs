//! Recordings of movements: a text format for programs and people.
//!
//! ```text
//!   7bot-recording 1                               the format and its version
//!   # seconds  joints 1 to 7 in degrees  vacuum    a comment
//!   0.000   90  90  65  90  90  90  80   0         one moment per line; vacuum: 1 sucks, 0 releases
//!   0.033   91  90  65  90  90  90  80   0
//! ```
//!
//! Version 2 has angles with up to two decimals, as the extended block takes them; version 1 has whole degrees.
//!
//! The joints move evenly between two moments. So a movement written by hand needs a line only where its direction or
//! speed changes.

use std::time::Duration;

use protocol_core::registers::Joint;

use crate::units::Speed;

mod line;
mod lines;
mod version;

pub use line::{LineError, Moment};
pub use lines::RecordingLines;
pub use version::FileVersion;

/// The first word of every recording.
const FORMAT: &str = "7bot-recording";
/// Rounding to whole degrees can add one degree to a distance.
const ROUNDING_DEGREES: f64 = 1.0;

/// A movement: at least one moment, in ascending order of time.
///
/// ```
/// use sevenbot::recording::Recording;
///
/// # fn main() -> Result<(), sevenbot::recording::RecordingError> {
/// let text = "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n1.5 120 90 65 90 90 90 80 1\n";
/// let recording = Recording::parse(text)?;
/// assert_eq!(recording.duration().as_millis(), 1500);
/// recording.check_speeds(2.0)?;
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// Each moment with its line number, or counted from 1 if there is no text.
    moments: Vec<(usize, Moment)>,
}

/// Why a text or a list of moments is not a recording, or cannot be played.
///
/// ```
/// use sevenbot::recording::{Recording, RecordingError};
///
/// assert_eq!(Recording::parse("a shopping list"), Err(RecordingError::NotARecording));
/// assert_eq!(Recording::parse("7bot-recording 1\n"), Err(RecordingError::Empty));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordingError {
    /// The first line that is neither empty nor a comment is not the header of a recording.
    #[error("this is not a recording: it does not start with `{FORMAT} 1` or `{FORMAT} 2`")]
    NotARecording,
    /// The version of the format is neither 1 nor 2, or more words follow.
    #[error("the recording has version `{0}`; this program reads versions 1 and 2")]
    OtherVersion(String),
    /// There is no moment; a recording needs at least one.
    #[error("the recording contains no movement")]
    Empty,
    /// A line of the text is refused, or a moment of [`Recording::of_moments`], or a joint would be too fast.
    #[error("line {number}: {cause}")]
    Line {
        /// The line number from 1; without a text, the number of the moment.
        number: usize,
        /// The wrong field or time, or the joint that would be too fast.
        cause: LineError,
    },
}

impl Recording {
    /// Parses a recording.
    ///
    /// # Errors
    /// The text has no header or no moment, or another version. Otherwise the first line that is refused.
    pub fn parse(text: &str) -> Result<Self, RecordingError> {
        let mut lines = (1..).zip(text.lines()).filter(|(_, line)| has_content(line));
        let version = header(lines.next().map(|(_, line)| line))?;
        Self::in_order(lines.map(|(number, line)| (number, line::parse(line, version))))
    }

    /// From moments in ascending order of time.
    ///
    /// # Errors
    /// [`RecordingError::Empty`] if there are no moments. [`RecordingError::Line`] for the first moment that is not later than
    /// the one before, or that is later than a day; its `number` counts the moments from 1.
    pub fn of_moments(moments: impl IntoIterator<Item = Moment>) -> Result<Self, RecordingError> {
        Self::in_order((1..).zip(moments).map(|(number, moment)| (number, line::checked(moment))))
    }

    /// From moments with their numbers. Each must be later than the one before.
    fn in_order(
        numbered: impl Iterator<Item = (usize, Result<Moment, LineError>)>,
    ) -> Result<Self, RecordingError> {
        let mut moments: Vec<(usize, Moment)> = Vec::new();
        for (number, moment) in numbered {
            let at_line = |cause| RecordingError::Line { number, cause };
            let moment = moment.map_err(at_line)?;
            if let Some((_, before)) = moments.last().filter(|(_, before)| moment.time <= before.time) {
                return Err(at_line(LineError::NotLater { time: moment.time, before: before.time }));
            }
            moments.push((number, moment));
        }
        if moments.is_empty() { Err(RecordingError::Empty) } else { Ok(Self { moments }) }
    }

    /// The recording of a planned movement: at least one moment, in ascending order of time.
    pub(crate) fn from_moments(moments: impl Iterator<Item = Moment>) -> Self {
        Self { moments: (1..).zip(moments).collect() }
    }

    /// The moments in ascending order of time.
    pub fn moments(&self) -> impl Iterator<Item = Moment> {
        self.moments.iter().map(|&(_, moment)| moment)
    }

    /// The time from the first moment to the last.
    #[must_use]
    pub fn duration(&self) -> Duration {
        match self.moments.as_slice() {
            [(_, first), .., (_, last)] => last.time - first.time,
            _ => Duration::ZERO,
        }
    }

    /// Checks that every joint can follow at `factor` times the recorded speed.
    ///
    /// # Errors
    /// The first moment that a joint cannot reach in time.
    pub fn check_speeds(&self, factor: f64) -> Result<(), RecordingError> {
        let pairs = self.moments.iter().zip(self.moments.iter().skip(1));
        for ((_, from), (number, to)) in pairs {
            if let Some(cause) = too_fast(from, to, factor) {
                return Err(RecordingError::Line { number: *number, cause });
            }
        }
        Ok(())
    }
}

/// Is the line neither empty nor a comment?
fn has_content(line: &str) -> bool {
    let line = line.trim();
    !line.is_empty() && !line.starts_with('#')
}

fn header(line: Option<&str>) -> Result<FileVersion, RecordingError> {
    // Some editors write a byte order mark at the start.
    let mut words = line.unwrap_or_default().trim_start_matches('\u{feff}').split_whitespace();
    let (format, word, more) = (words.next(), words.next(), words.next());
    if format != Some(FORMAT) {
        return Err(RecordingError::NotARecording);
    }
    let version = FileVersion::ALL.into_iter().find(|version| Some(version.word()) == word && more.is_none());
    version.ok_or_else(|| RecordingError::OtherVersion(word.unwrap_or_default().to_owned()))
}

fn too_fast(from: &Moment, to: &Moment, factor: f64) -> Option<LineError> {
    let seconds = (to.time - from.time).as_secs_f64() / factor;
    let reach = Speed::MAXIMUM.degrees_per_second() * seconds + ROUNDING_DEGREES;
    let pairs = from.pose.iter().zip(&to.pose).zip(Joint::ALL);
    pairs
        .map(|((from, to), joint)| (joint, (from.degrees() - to.degrees()).abs()))
        .find(|&(_, degrees)| degrees > reach)
        .map(|(joint, degrees)| LineError::TooFast { joint, degrees_per_second: degrees / seconds })
}

/// The lines at the start of a recording. A line for each moment follows ([`Moment::line`]).
#[must_use]
pub fn head(version: FileVersion) -> String {
    format!("{FORMAT} {}\n# seconds  joints 1 to 7 in degrees  vacuum (1: suck)\n", version.word())
}

#[cfg(test)]
mod tests {
    use super::*;

    const WAVE: &str =
        "7bot-recording 1\n\n# by hand\n0 90 90 65 90 90 90 80 0\n1.5 120 90 65 90 90 90 80 1\n";

    fn refused(text: &str) -> String {
        Recording::parse(text).expect_err("it is wrong").to_string()
    }

    #[test]
    fn a_formatted_recording_parses_to_the_same() {
        let recording = Recording::parse(WAVE).expect("a recording");
        let lines = recording.moments().map(|moment| moment.line(FileVersion::Degrees) + "\n");
        let text: String = std::iter::once(head(FileVersion::Degrees)).chain(lines).collect();
        assert!(text.ends_with("1.500 120  90  65  90  90  90  80   1\n"), "{text}");
        let again = Recording::parse(&text).expect("a recording");
        assert!(again.moments().eq(recording.moments()));
        assert_eq!(again.duration(), Duration::from_millis(1500));
    }

    #[test]
    fn byte_order_mark_and_crlf_are_accepted() {
        let text = format!("\u{feff}{}", WAVE.replace('\n', "\r\n"));
        assert_eq!(Recording::parse(&text), Recording::parse(WAVE));
    }

    #[test]
    fn errors_name_their_line() {
        assert!(refused("").contains("not a recording"));
        assert!(refused("seconds,joint\n").contains("not a recording"));
        assert!(refused("7bot-recording 3\n").contains("version `3`"));
        assert!(refused("# no\n7bot-recording 1\n").contains("no movement"));
        let line = |line: &str| refused(&format!("{WAVE}{line}\n"));
        assert_eq!(line("2 90 90"), "line 6: 3 fields instead of 9: seconds, seven angles, vacuum");
        assert_eq!(line("x 90 90 65 90 90 90 80 0"), "line 6: `x` is not a time in seconds, up to a day");
        assert!(line("-1 90 90 65 90 90 90 80 0").contains("`-1` is not a time"));
        assert!(line("NaN 90 90 65 90 90 90 80 0").contains("`NaN` is not a time"));
        assert_eq!(
            line("1.5 90 90 65 90 90 90 80 0"),
            "line 6: the time 1.5 s is not later than 1.5 s, the one before"
        );
        let angle = line("2 90 90 181 90 90 90 80 0");
        assert_eq!(angle, "line 6: joint 3 cannot go to `181`: whole degrees from 0 to 180");
        assert!(line("2 90 90 65.5 90 90 90 80 0").contains("whole degrees"));
        assert!(line("2 90 90 65 90 90 90 80 on").contains("`on` is not a pump state"));
    }

    #[test]
    fn a_movement_too_fast_for_the_motors_is_refused() {
        let recording = Recording::parse(WAVE).expect("a recording");
        assert_eq!(recording.check_speeds(1.0), Ok(()));
        let text = recording.check_speeds(20.0).expect_err("30 degrees in 75 ms").to_string();
        assert_eq!(
            text,
            "line 5: joint 1 would have to turn at 400 °/s; the motors reach 372: give this line a later time, or play slower"
        );
    }

    #[test]
    fn rounding_at_full_speed_is_not_too_fast() {
        // 372 °/s at 30 Hz is 12.4 degrees a line: 12 or 13 when rounded.
        let text = "7bot-recording 1\n0 10 0 0 0 0 0 0 0\n0.033 23 0 0 0 0 0 0 0\n";
        assert_eq!(Recording::parse(text).expect("a recording").check_speeds(1.0), Ok(()));
    }

    #[test]
    fn version_2_has_hundredths_of_a_degree() {
        let text = "7bot-recording 2\n0 90.25 90 65.5 90 90 90 80 0\n1.5 120.01 90 65 90 90 90 180.00 1\n";
        let recording = Recording::parse(text).expect("a recording");
        let lines = recording.moments().map(|moment| moment.line(FileVersion::Hundredths) + "\n");
        let written: String = std::iter::once(head(FileVersion::Hundredths)).chain(lines).collect();
        assert!(
            written.contains("\n0.000  90.25  90.00  65.50  90.00  90.00  90.00  80.00   0\n"),
            "{written}"
        );
        let again = Recording::parse(&written).expect("a recording");
        assert!(again.moments().eq(recording.moments()));
        let refused = refused("7bot-recording 2\n0 90.255 90 65 90 90 90 80 0\n");
        assert_eq!(
            refused,
            "line 2: joint 1 cannot go to `90.255`: degrees from 0 to 180, with up to two decimals"
        );
    }
}
