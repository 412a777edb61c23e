//! The lines of a recording that grows.

use std::time::Duration;

use super::{FileVersion, Moment, head};

/// The times of a file are milliseconds.
const RESOLUTION: Duration = Duration::from_millis(1);

/// The lines of a recording that grows: moments in ascending order of time.
///
/// ```
/// use sevenbot::recording::{FileVersion, Moment, Recording, RecordingLines};
/// use sevenbot::{Angle, FineAngle};
/// use std::time::Duration;
///
/// let mut lines = RecordingLines::new(FileVersion::Hundredths);
/// let pose = [FineAngle::from(Angle::from_register(90)); 7];
/// let moment = Moment { time: Duration::from_millis(20), pose, vacuum: false };
/// let text = lines.head() + &lines.add(&moment).unwrap_or_default();
/// assert_eq!((lines.add(&moment), lines.count()), (None, 1), "not later than the last one");
/// assert!(Recording::parse(&text).is_ok());
/// ```
#[derive(Clone, Debug)]
pub struct RecordingLines {
    version: FileVersion,
    last: Option<Duration>,
    count: u64,
}

impl RecordingLines {
    /// The lines of a recording that has no moment yet.
    #[must_use]
    pub const fn new(version: FileVersion) -> Self {
        Self { version, last: None, count: 0 }
    }

    /// The text before the first moment.
    #[must_use]
    pub fn head(&self) -> String {
        head(self.version)
    }

    /// The line of a moment; `None` if it is not at least a millisecond later than the last one.
    pub fn add(&mut self, moment: &Moment) -> Option<String> {
        if self.last.is_some_and(|last| moment.time < last + RESOLUTION) {
            return None;
        }
        (self.last, self.count) = (Some(moment.time), self.count.saturating_add(1));
        Some(moment.line(self.version) + "\n")
    }

    /// The number of moments that [`Self::add`] took.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The time of the last moment; 0 if there is none.
    #[must_use]
    pub fn duration(&self) -> Duration {
        self.last.unwrap_or_default()
    }
}
