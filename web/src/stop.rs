//! A stop that is verified: the measured positions become the targets, and are read back.
//!
//! [`sevenbot::hold`] decides what to write, as for `sevenbot stop`. The registers here are those that are read in rounds.

use protocol_core::time::{Duration, Instant};
use sevenbot::Snapshot;
use sevenbot::hold::{HeldJoints, Hold, HoldStep};
use sevenbot::joints::{JointSnapshot, START_UP_TIME};
use sevenbot::map::{SET_POINT_PERIOD, STATUS_VERSION};
use sevenbot::status_block::StatusBlock;

use crate::arm_state::has_extended_block;

/// An address and its values.
type Frame = (u8, Vec<u8>);

/// How far a stop has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopProgress {
    /// Nobody asked for one.
    #[default]
    None,
    /// The targets were written, and are not read back yet.
    Verifying,
    /// The arm has the targets that hold it.
    Holds,
    /// The motors are off: there is nothing to stop.
    NotDriven,
    /// The arm did not take the targets. It may be moving.
    Failed,
}

/// A stop in progress.
#[derive(Debug, Default)]
pub struct Stop {
    progress: StopProgress,
    hold: Hold,
    /// When the first step was taken.
    start: Option<Instant>,
    /// The next step needs this many complete rounds.
    next_round: u64,
}

impl Stop {
    /// Begins a stop.
    pub fn start(&mut self) {
        *self = Self { progress: StopProgress::Verifying, ..Self::default() };
    }

    /// How far the stop has come.
    #[must_use]
    pub const fn progress(&self) -> StopProgress {
        self.progress
    }

    /// The frames to write after a round, given the number of complete rounds.
    pub fn frames(&mut self, now: Instant, registers: &Snapshot, rounds: u64) -> Vec<Frame> {
        if self.progress != StopProgress::Verifying || rounds < self.next_round {
            return Vec::new();
        }
        let start_up = Duration::from_micros(u64::try_from(START_UP_TIME.as_micros()).unwrap_or(u64::MAX));
        let is_past_start_up = now >= *self.start.get_or_insert(now) + start_up;
        self.progress = match self.hold.step(&held_joints(registers), is_past_start_up) {
            HoldStep::Wait => return Vec::new(),
            HoldStep::Write(targets) => {
                // The next round may have been on its way before these targets.
                self.next_round = rounds + 2;
                // With a period, a target would be one more point of a stream (D23). Later moves need their speed.
                let ends_stream =
                    has_extended_block(registers).then(|| (SET_POINT_PERIOD.address, vec![0, 0]));
                return ends_stream.into_iter().chain(targets).collect();
            }
            HoldStep::Holds => StopProgress::Holds,
            HoldStep::NotDriven => StopProgress::NotDriven,
            HoldStep::NotTaken(_) => StopProgress::Failed,
        };
        Vec::new()
    }
}

fn held_joints(registers: &Snapshot) -> HeldJoints {
    let all = || registers.clone();
    let has_status = registers.byte(&STATUS_VERSION) == 1;
    let joints = JointSnapshot::new(all(), has_status.then(|| StatusBlock::from(all())));
    HeldJoints::new(joints, has_extended_block(registers).then(all))
}
