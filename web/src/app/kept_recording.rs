//! The recording of the page, which the browser's storage keeps across a reload.

use std::time::Duration;

use sevenbot::recording::{Recording, RecordingError};

use super::storage;

/// The key of the recording in the browser's storage.
const KEPT: &str = "recording";

/// The recording of the page: recorded, or opened from a file.
pub(super) struct KeptRecording {
    pub(super) text: String,
    pub(super) moments: usize,
    /// The time of the last moment.
    pub(super) length: Duration,
}

impl KeptRecording {
    /// Loads the recording from the browser's storage.
    pub(super) fn of_storage() -> Option<Self> {
        storage::load(KEPT).and_then(|text| Self::parse(text).ok())
    }

    /// Saves the recording in the browser's storage.
    pub(super) fn store(&self) {
        storage::save(KEPT, &self.text);
    }

    pub(super) fn parse(text: String) -> Result<Self, RecordingError> {
        let recording = Recording::parse(&text)?;
        let length = recording.moments().last().map_or(Duration::ZERO, |last| last.time);
        Ok(Self { moments: recording.moments().count(), length, text })
    }
}
