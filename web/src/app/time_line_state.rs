//! What the page has of time lines.

use std::time::Duration;

use crate::preview::Preview;
use crate::scene::Angles;
use crate::time_line::{Stand, TimeLine};

/// The preview that runs, and the movement that is shown, at this moment.
#[derive(Default)]
pub(super) struct TimeLines {
    pub(super) preview: Option<Preview>,
    pub(super) shown: Option<TimeLine>,
    /// It is that of a program, not of a recording.
    pub(super) is_preview: bool,
    pub(super) at: Duration,
}

impl TimeLines {
    pub(super) fn stand(&self) -> Option<Stand> {
        self.shown.as_ref()?.at(self.at)
    }

    /// The angles of the ghost.
    pub(super) fn angles(&self) -> Option<Angles> {
        self.stand().map(|stand| stand.angles)
    }

    /// The block of the program at this moment.
    pub(super) fn block(&self) -> Option<String> {
        self.stand()?.block.map(|block| block.to_string())
    }
}
