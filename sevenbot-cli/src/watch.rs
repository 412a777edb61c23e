//! Progress bars, and Ctrl-C, for calls of the library that take a while.

use sevenbot::Arm;
use sevenbot::moves::{JointMove, Observer, Stage};
use sevenbot::recording::{Moment, Recording};

use crate::command_error::CommandError;
use crate::interrupt::Interrupt;
use crate::printer::note;
use crate::progress::Progress;

const ROUNDING: &str = "this arm takes whole degrees: each joint goes to the nearest one";

/// Shows a bar for each stage of a call, and ends the call after Ctrl-C.
pub(crate) struct ProgressWatch {
    bar: Option<(&'static str, Progress)>,
}

impl ProgressWatch {
    /// Needs an [`Interrupt`], because only that catches Ctrl-C.
    pub(crate) const fn new(_: Interrupt) -> Self {
        Self { bar: None }
    }
}

impl Observer for ProgressWatch {
    fn goes_on(&mut self) -> bool {
        !Interrupt::is_requested()
    }

    fn progress(&mut self, stage: Stage, done: u64, total: u64) {
        let unit = stage.unit();
        if self.bar.as_ref().is_none_or(|(shown, _)| *shown != unit) {
            // The old bar goes first, so that it leaves the screen.
            self.bar = None;
            self.bar = Some((unit, Progress::new(total, unit)));
        }
        if let Some((_, bar)) = &self.bar {
            bar.set(done);
            bar.say(if stage == Stage::Settling { "settling" } else { "" });
        }
    }
}

/// Tells the user if a move goes to whole degrees only.
pub(crate) fn note_rounding(begun: &JointMove) {
    if begun.is_rounded() {
        note(ROUNDING);
    }
}

/// As [`note_rounding`], before a recording is played.
pub(crate) fn note_rounding_of(recording: &Recording, arm: &mut Arm) -> Result<(), CommandError> {
    let is_whole = |moment: Moment| moment.pose.iter().all(|angle| angle.is_whole());
    if !recording.moments().all(is_whole) && !arm.has_extended_block()? {
        note(ROUNDING);
    }
    Ok(())
}
