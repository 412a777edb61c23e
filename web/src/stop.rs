//! A stop of the page: the shell around [`Hold`], which decides what to write and when, as for `sevenbot stop`.

use std::time::Duration;

use protocol_core::time::Instant;
use sevenbot::Snapshot;
use sevenbot::hold::{HeldJoints, Hold, HoldStep};
use sevenbot::map::SPEED;

/// Writes of registers: first address, values.
type RegisterWrites = Vec<(u8, Vec<u8>)>;

/// What became of the last stop of the page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopProgress {
    /// There was no stop, or the arm got another command after it.
    #[default]
    None,
    /// The stop was begun, but the arm has not confirmed it yet.
    Verifying,
    /// The arm has confirmed the targets that hold it.
    Holds,
    /// The motors are off or damped: there is nothing to stop.
    NotDriven,
    /// The arm did not take the targets after several attempts. It may be moving.
    Failed,
}

/// The last stop, and its progress.
#[derive(Debug, Default)]
pub struct ArmStop {
    progress: StopProgress,
    hold: Hold,
}

impl ArmStop {
    /// Begins a stop. `registers` are the last known ones; `None` if they were not read yet. `speeds` are the speeds to restore,
    /// if those in the registers are temporary. Does nothing while another stop is not confirmed yet.
    pub fn start(&mut self, registers: Option<&Snapshot>, speeds: Option<[u8; 7]>) {
        if self.progress == StopProgress::Verifying {
            return;
        }
        let hold = self.hold.again(registers.map(HeldJoints::of).as_ref());
        self.hold = speeds.map_or(hold.clone(), |speeds| hold.restoring(speeds));
        self.progress = StopProgress::Verifying;
    }

    /// The progress of the last stop.
    #[must_use]
    pub const fn progress(&self) -> StopProgress {
        self.progress
    }

    /// Resets the result of a completed stop, because the arm got another command. A stop in progress continues.
    pub fn forget(&mut self) {
        if self.progress != StopProgress::Verifying {
            self.progress = StopProgress::None;
        }
    }

    /// Takes registers that arrived at `now`, from reads that were sent at `asked` or later.
    pub fn registers(&mut self, asked: Instant, now: Instant, registers: &Snapshot) {
        if self.progress == StopProgress::Verifying {
            self.hold.joints(since_start(asked), since_start(now), &HeldJoints::of(registers));
        }
    }

    /// The frames to write now, before all other queued frames. Also updates the progress.
    pub fn frames(&mut self, now: Instant) -> RegisterWrites {
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

/// The frames that make the joints hold without a confirmation, and then set these speeds. If the motors are off or damped, the
/// frames only set the speeds.
pub(crate) fn hold_frames(registers: &Snapshot, speeds: [u8; 7]) -> RegisterWrites {
    let frames = match Hold::at_once(Some(&HeldJoints::of(registers))).poll(Duration::ZERO) {
        HoldStep::Write(frames) => frames,
        // The motors are off or damped: no joint has to hold.
        _ => RegisterWrites::new(),
    };
    frames.into_iter().chain([(SPEED.address, speeds.to_vec())]).collect()
}

/// Converts an instant to the time since the start of its clock.
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
        // The page has left: it discards the replies.
        (0..200).for_each(|_| tab.arm.advance(10_000.0, || true));
        let left = tab.angles()[0];
        assert!(at_end < 140.0 && (at_end - left).abs() < 10.0, "from {at_end} to {left}");
        tab.client = crate::client::Client::default();
        tab.pass(60);
        assert_eq!(tab.client.registers().joints(&SPEED), speeds);
    }
}
