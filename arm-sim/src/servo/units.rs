//! The units in which motors are simulated: steps of 1 ms, and whole millionths of a count.

use protocol_core::time::Duration;

pub(crate) const STEP: Duration = Duration::from_millis(1);
/// A count. Positions are in millionths of a count, so that a count per second is a whole number per step.
pub(crate) const COUNT: i64 = 1_000_000;
/// A count per second, as the distance in a step.
pub(crate) const COUNT_PER_SECOND: i64 = COUNT / 1_000;
