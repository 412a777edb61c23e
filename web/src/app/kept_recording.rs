//! The recording of the page, which the browser keeps over a reload.

use std::time::Duration;

use sevenbot::recording::{Recording, RecordingError};

use super::storage;

/// Its name in the browser's storage.
const KEPT: &str = "recording";

/// The recording that the page has.
pub(super) struct KeptRecording {
    pub(super) text: String,
    /// The number of its moments, and the time of the last one.
    pub(super) moments: usize,
    pub(super) length: Duration,
}

impl KeptRecording {
    /// The recording of the page before it was loaded again.
    pub(super) fn of_storage() -> Option<Self> {
        storage::load(KEPT).and_then(|text| Self::parse(text).ok())
    }

    /// Keeps it over a reload.
    pub(super) fn store(&self) {
        storage::save(KEPT, &self.text);
    }

    pub(super) fn parse(text: String) -> Result<Self, RecordingError> {
        let recording = Recording::parse(&text)?;
        let length = recording.moments().last().map_or(Duration::ZERO, |last| last.time);
        Ok(Self { moments: recording.moments().count(), length, text })
    }
}
