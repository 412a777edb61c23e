//! Trials of the parser on a disturbed line: the trials of protocol-core's tests, with any seed.

use crate::shared::disturbed_line::{self, Disturbance};
use crate::shared::stream;

/// The largest number of lost frames in a million. Noise may complete a frame to a valid checksum by chance.
const MAX_LOST_PER_MILLION: usize = 5;

/// The result for one kind of disturbance.
#[derive(Clone, Copy, Debug)]
pub struct ParserTrial {
    /// The kind of disturbance.
    pub name: &'static str,
    /// Good frames that were sent.
    pub frames: usize,
    /// Good frames that the parser did not return.
    pub lost: usize,
    /// The longest time from the last byte of a good frame to its return, less the duration of the burst of frames that contains
    /// it, in microseconds.
    pub worst_delay_us: u64,
}

impl ParserTrial {
    /// True if lost frames and delays are within their limits.
    #[must_use]
    pub const fn passed(&self) -> bool {
        let max_lost = (self.frames * MAX_LOST_PER_MILLION).div_ceil(1_000_000);
        self.lost <= max_lost && self.worst_delay_us <= stream::GAP_US
    }
}

/// The number of kinds of disturbance.
pub const DISTURBANCES: usize = Disturbance::ALL.len();

/// Sends good frames over a line with one kind of disturbance; `None` if there is no such kind.
#[must_use]
pub fn run(kind: usize, seed: u64, frames: usize) -> Option<ParserTrial> {
    let disturbance = *Disturbance::ALL.get(kind)?;
    let counts = disturbed_line::run(disturbance, seed, frames);
    let disturbed_line::Tally { frames, lost, worst_delay_us } = counts;
    Some(ParserTrial { name: disturbance.name(), frames, lost, worst_delay_us })
}
