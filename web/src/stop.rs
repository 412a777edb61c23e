//! A stop of the page: [`Hold`] decides what to write and when, as for `sevenbot stop`. Here are its clock and its news.

use std::time::Duration;

use protocol_core::time::Instant;
use sevenbot::Snapshot;
use sevenbot::hold::{HeldJoints, Hold, HoldStep};
use sevenbot::map::SPEED;

/// Addresses and their values.
type Frames = Vec<(u8, Vec<u8>)>;

/// How far a stop has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopProgress {
    /// Nobody asked for one.
    #[default]
    None,
    /// It was written, and is not confirmed yet.
    Verifying,
    /// The arm has the targets that hold it.
    Holds,
    /// The motors are off: there is nothing to stop.
    NotDriven,
    /// The arm did not take the targets. It may be moving.
    Failed,
}

/// The last stop.
#[derive(Debug, Default)]
pub struct Stop {
    progress: StopProgress,
    hold: Hold,
}

impl Stop {
    /// Begins a stop of an arm with these registers; `None` if they were not read yet. `speeds` are those to restore, if
    /// the registers hold others for a while. A stop that is not confirmed goes on.
    pub fn start(&mut self, registers: Option<&Snapshot>, speeds: Option<[u8; 7]>) {
        if self.progress == StopProgress::Verifying {
            return;
        }
        let hold = self.hold.again(registers.map(HeldJoints::of).as_ref());
        self.hold = speeds.map_or(hold.clone(), |speeds| hold.restoring(speeds));
        self.progress = StopProgress::Verifying;
    }

    /// How far the stop has come.
    #[must_use]
    pub const fn progress(&self) -> StopProgress {
        self.progress
    }

    /// The arm was told something else: what the stop has found out is no longer news.
    pub fn forget(&mut self) {
        if self.progress != StopProgress::Verifying {
            self.progress = StopProgress::None;
        }
    }

    /// Takes registers that came at `now`, from reads that were sent at `asked` or later.
    pub fn registers(&mut self, asked: Instant, now: Instant, registers: &Snapshot) {
        if self.progress == StopProgress::Verifying {
            self.hold.joints(since_start(asked), since_start(now), &HeldJoints::of(registers));
        }
    }

    /// The frames to write now, before everything else.
    pub fn frames(&mut self, now: Instant) -> Frames {
        if self.progress != StopProgress::Verifying {
            return Vec::new();
        }
        match self.hold.poll(since_start(now)) {
            HoldStep::Write(frames) => return frames,
            HoldStep::Read | HoldStep::Wait(_) => {}
            HoldStep::Holds(_) => self.progress = StopProgress::Holds,
            HoldStep::NotDriven(_) => self.progress = StopProgress::NotDriven,
            HoldStep::NotTaken(_) => self.progress = StopProgress::Failed,
        }
        Vec::new()
    }
}

/// What lets the joints of these registers hold without a confirmation, and then gives them these speeds.
pub(crate) fn hold_frames(registers: &Snapshot, speeds: [u8; 7]) -> Frames {
    let frames = match Hold::at_once(Some(&HeldJoints::of(registers))).poll(Duration::ZERO) {
        HoldStep::Write(frames) => frames,
        // The motors are off.
        _ => Frames::new(),
    };
    frames.into_iter().chain([(SPEED.address, speeds.to_vec())]).collect()
}

/// The time since the start of the page's clock.
#[must_use]
pub const fn since_start(now: Instant) -> Duration {
    Duration::from_micros(now.as_micros())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm_state::target_frame;
    use crate::source::Source;
    use crate::tab::Tab;

    #[test]
    fn an_arm_that_is_left_holds_and_has_its_speeds() {
        let mut tab = Tab::new();
        let (address, values) = target_frame(tab.client.registers(), 1, 175.0).expect("a target");
        tab.client.write(tab.now(), address, &values);
        tab.pass(20);
        let (at_end, speeds) = (tab.angles()[0], tab.client.registers().joints(&SPEED));
        let bytes = tab.client.hold_and_leave(tab.now(), speeds);
        tab.arm.send(&bytes);
        // Nobody reads the line.
        (0..200).for_each(|_| tab.arm.advance(10_000.0, || true));
        let left = tab.angles()[0];
        assert!(at_end < 140.0 && (at_end - left).abs() < 10.0, "from {at_end} to {left}");
        tab.client = crate::client::Client::default();
        tab.pass(60);
        assert_eq!(tab.client.registers().joints(&SPEED), speeds);
    }
}
