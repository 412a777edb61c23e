//! The state of the page for time lines.

use std::time::Duration;

use crate::preview::Preview;
use crate::scene::Angles;
use crate::time_line::{Stand, TimeLine};

/// The running preview, and the shown movement with its chosen moment.
#[derive(Default)]
pub(super) struct TimeLines {
    pub(super) preview: Option<Preview>,
    pub(super) shown: Option<TimeLine>,
    /// True if the shown movement is the preview of a program, false for a recording.
    pub(super) is_preview: bool,
    /// The chosen moment.
    pub(super) at: Duration,
}

impl TimeLines {
    pub(super) fn stand(&self) -> Option<Stand> {
        self.shown.as_ref()?.at(self.at)
    }

    /// The angles of the ghost at the chosen moment, in degrees.
    pub(super) fn angles(&self) -> Option<Angles> {
        self.stand().map(|stand| stand.angles)
    }

    /// The block of the program at the chosen moment.
    pub(super) fn block(&self) -> Option<String> {
        self.stand()?.block.map(|block| block.to_string())
    }
}
