//! The formats, and their file name extensions.

use std::path::Path;

/// A format of a recording.
///
/// ```
/// use recording_formats::Format;
/// use std::path::Path;
///
/// assert_eq!(Format::of_name(Path::new("wave.mcap")), Some(Format::Mcap));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// The text format of `sevenbot record`: [`sevenbot::recording`].
    Text,
    /// Values separated by commas, with angles in degrees.
    Csv,
    /// MCAP with messages of ROS 2, with angles in radians.
    Mcap,
}

impl Format {
    /// All formats, the text format first.
    pub const ALL: [Self; 3] = [Self::Text, Self::Csv, Self::Mcap];

    /// Its file name extension, without the dot.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Text => "txt",
            Self::Csv => "csv",
            Self::Mcap => "mcap",
        }
    }

    /// The format with the extension of this file name, in upper or lower case; `None` for any other extension.
    #[must_use]
    pub fn of_name(path: &Path) -> Option<Self> {
        let end = path.extension()?.to_str()?;
        Self::ALL.into_iter().find(|format| end.eq_ignore_ascii_case(format.extension()))
    }
}
