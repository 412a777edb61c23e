//! Progress bars, and Ctrl-C, for calls of the library that take a while.

use sevenbot::fine::FineTargets;
use sevenbot::moves::{JointMove, Observer, PaceBefore, Stage};
use sevenbot::recording::{Moment, Recording};
use sevenbot::register_text::joints;
use sevenbot::{Arm, Firmware, MoveTime, Speed};

use crate::command_error::CommandError;
use crate::interrupt::Interrupt;
use crate::printer::note;
use crate::progress::Progress;

const ROUNDING: &str = "this arm takes whole degrees: each joint goes to the nearest one";

/// Shows a bar for each stage of a call, one for stages with the same unit, and ends the call after Ctrl-C.
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

/// Tells the user if the targets of a move were rounded to whole degrees.
pub(crate) fn note_rounding(begun: &JointMove) {
    if begun.is_rounded() {
        note(ROUNDING);
    }
}

/// Tells the user which joints do not move at the default speed: their registers were set on purpose, or a command was killed
/// before it could put them back. Only on this project's firmware: the maker's has other defaults.
pub(crate) fn note_other_pace(arm: &mut Arm, targets: &FineTargets) -> Result<(), CommandError> {
    if arm.identity().firmware() != Firmware::Ours {
        return Ok(());
    }
    note_paces(PaceBefore::read(arm, targets)?.other_than_default());
    Ok(())
}

/// Tells the user which joints are slower than the default: no joint follows a stream faster than its speed.
pub(crate) fn note_slow_joints(arm: &mut Arm, targets: &FineTargets) -> Result<(), CommandError> {
    let mut slow = PaceBefore::read(arm, targets)?.other_than_default();
    slow.retain(|(_, speed, _)| speed.degrees_per_second() < Speed::DEFAULT.degrees_per_second());
    note_paces(slow);
    Ok(())
}

fn note_paces(others: Vec<(u8, Speed, MoveTime)>) {
    let paces = others.into_iter().map(|(bits, speed, time)| match time {
        MoveTime::NONE => format!("{}: {:.1} degrees/s", joints(bits), speed.degrees_per_second()),
        time => format!("{}: {:.1} s for each move", joints(bits), time.duration().as_secs_f64()),
    });
    let paces = paces.collect::<Vec<_>>().join("; ");
    if !paces.is_empty() {
        let (steps, speed) = (Speed::DEFAULT.steps(), Speed::DEFAULT.degrees_per_second());
        note(format_args!(
            "{paces}, as the registers of speed and duration say; `sevenbot set speed {steps}` sets the default of {speed} \
             degrees/s"
        ));
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
