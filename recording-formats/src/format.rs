//! The formats, and the ends of the names of their files.

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
    /// That of `sevenbot record`: [`sevenbot::recording`].
    Text,
    /// Values with commas, in degrees.
    Csv,
    /// MCAP with messages of ROS 2, in radians.
    Mcap,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Text, Self::Csv, Self::Mcap];

    /// The end of the names of its files, without the dot.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Text => "txt",
            Self::Csv => "csv",
            Self::Mcap => "mcap",
        }
    }

    /// The format that the end of a file's name tells.
    #[must_use]
    pub fn of_name(path: &Path) -> Option<Self> {
        let end = path.extension()?.to_str()?;
        Self::ALL.into_iter().find(|format| end.eq_ignore_ascii_case(format.extension()))
    }
}
