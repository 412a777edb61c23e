//! The parser on a disturbed line: the campaign of protocol-core's own tests, from any seed.

use crate::shared::disturbed_line::{self, Disturbance};
use crate::shared::stream;

/// Lost frames in a million that are noise which completes to a right checksum by chance.
const MOST_LOST_IN_A_MILLION: usize = 5;

/// What came of one kind of disturbance.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// What was done to the line.
    pub name: &'static str,
    /// How many good frames were sent.
    pub frames: usize,
    /// How many of them never came out.
    pub lost: usize,
    /// The worst delay past the burst, in microseconds.
    pub worst_delay_us: u64,
}

impl Line {
    /// Were more frames lost, or later, than may be?
    #[must_use]
    pub const fn is_good(&self) -> bool {
        let most = (self.frames * MOST_LOST_IN_A_MILLION).div_ceil(1_000_000);
        self.lost <= most && self.worst_delay_us <= stream::GAP_US
    }
}

/// How many kinds of disturbance there are.
pub const KINDS: usize = Disturbance::ALL.len();

/// Sends so many good frames over a line that is disturbed in one way; `None` if there is no such kind.
#[must_use]
pub fn run(kind: usize, seed: u64, frames: usize) -> Option<Line> {
    let disturbance = *Disturbance::ALL.get(kind)?;
    let tally = disturbed_line::run(disturbance, seed, frames);
    let disturbed_line::Tally { frames, lost, worst_delay_us } = tally;
    Some(Line { name: disturbance.name(), frames, lost, worst_delay_us })
}
