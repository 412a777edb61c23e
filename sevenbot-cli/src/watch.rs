//! Progress bars, and Ctrl-C, for calls of the library that take a while.

use sevenbot::fine::FineTargets;
use sevenbot::moves::{JointMove, Observer, PaceBefore, Stage};
use sevenbot::recording::{Moment, Recording};
use sevenbot::register_text::joints;
use sevenbot::{Arm, Speed};

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
    /// Needs an [`Interrupt`], because only [`Interrupt::catch`] catches Ctrl-C.
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
            // Drop the old bar first, so that it leaves the screen.
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

/// Tells the user which joints will not move at the default speed, because a command left them another one: on purpose, or
/// because it was killed before it could put the old speed back.
pub(crate) fn note_other_pace(arm: &mut Arm, targets: &FineTargets) -> Result<(), CommandError> {
    for (bits, pace) in PaceBefore::read(arm, targets)?.other_than_default() {
        let speed = pace.speed.map_or(0.0, Speed::degrees_per_second);
        let speed = match pace.time {
            Some(time) => format!("{:.1} s for each move", time.duration().as_secs_f64()),
            None => format!("{speed:.1} degrees/s"),
        };
        note(format_args!(
            "{}: {speed}, as an earlier command left it; `sevenbot set speed 60` sets the default of 114 degrees/s",
            joints(bits)
        ));
    }
    Ok(())
}

/// As [`note_rounding`], before a recording is played.
pub(crate) fn note_rounding_of(recording: &Recording, arm: &mut Arm) -> Result<(), CommandError> {
    let is_whole = |moment: Moment| moment.pose.iter().all(|angle| angle.is_whole());
    if !recording.moments().all(is_whole) && !arm.has_extended_block()? {
        note(ROUNDING);
    }
    Ok(())
}
