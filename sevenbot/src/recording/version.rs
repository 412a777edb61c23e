//! The versions of the text format.

/// The version of the format, the second word of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileVersion {
    /// Version 1: angles in whole degrees.
    Degrees,
    /// Version 2: angles with up to two decimals.
    Hundredths,
}

impl FileVersion {
    /// All versions, in ascending order.
    pub(super) const ALL: [Self; 2] = [Self::Degrees, Self::Hundredths];

    /// The second word of the file.
    pub(super) const fn word(self) -> &'static str {
        match self {
            Self::Degrees => "1",
            Self::Hundredths => "2",
        }
    }
}
