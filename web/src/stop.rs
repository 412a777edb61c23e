//! A stop that is verified: the measured positions become the targets, and are read back.
//!
//! As `sevenbot stop` does it, with registers that are read in rounds.

use sevenbot::map::{
    FINE_POSITION, FINE_TARGET, MOTOR_STATE, PRESENT_POSITION, SET_POINT_PERIOD, TARGET_POSITION, motor_state,
};
use sevenbot::{FineAngle, Joint, Snapshot};

use crate::arm_state::has_extended_block;

/// The targets are written this many times before the stop has failed.
const ATTEMPTS: u32 = 5;

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
    attempts: u32,
    /// The rounds that were complete when the last targets were written.
    written_in: u64,
    sent: Vec<(u8, u16)>,
}

impl Stop {
    /// Begins a stop after this number of complete rounds.
    pub fn start(&mut self, rounds: u64) {
        *self = Self { progress: StopProgress::Verifying, written_in: rounds, ..Self::default() };
    }

    /// How far the stop has come.
    #[must_use]
    pub const fn progress(&self) -> StopProgress {
        self.progress
    }

    /// The frames to write after a round, given the number of complete rounds. A round that was already on its way when the
    /// targets were written shows the targets before it.
    pub fn frames(&mut self, registers: &Snapshot, rounds: u64) -> Vec<(u8, Vec<u8>)> {
        let is_old = !self.sent.is_empty() && rounds <= self.written_in + 1;
        if self.progress != StopProgress::Verifying || is_old {
            return Vec::new();
        }
        if registers.byte(&MOTOR_STATE) != motor_state::SERVO {
            self.progress = StopProgress::NotDriven;
            return Vec::new();
        }
        let is_fine = has_extended_block(registers);
        let value = |address| if is_fine { registers.word(address) } else { registers.at(address).into() };
        if !self.sent.is_empty() && self.sent.iter().all(|&(address, sent)| value(address) == sent) {
            self.progress = StopProgress::Holds;
            return Vec::new();
        }
        if self.attempts >= ATTEMPTS {
            self.progress = StopProgress::Failed;
            return Vec::new();
        }
        self.attempts += 1;
        self.written_in = rounds;
        let (target, position) =
            if is_fine { (&FINE_TARGET, &FINE_POSITION) } else { (&TARGET_POSITION, &PRESENT_POSITION) };
        let held = |joint| (target.of(joint), value(position.of(joint)));
        let is_measured = |&(_, value): &(u8, u16)| FineAngle::from_hundredths(value).is_some();
        self.sent = Joint::ALL.map(held).into_iter().filter(is_measured).collect();
        // With a period, a target would be one more point of a stream (D23).
        let ends_stream = is_fine.then(|| (SET_POINT_PERIOD.address, vec![0, 0]));
        let bytes = |[low, high]: [u8; 2]| if is_fine { vec![low, high] } else { vec![low] };
        let frame = |&(address, value): &(u8, u16)| (address, bytes(value.to_le_bytes()));
        ends_stream.into_iter().chain(self.sent.iter().map(frame)).collect()
    }
}
