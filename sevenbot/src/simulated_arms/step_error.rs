//! Why arms that step together did not step.

use std::time::Duration;

/// The largest magnitude of a measurement, in its unit. A larger one is an error of the other simulation.
pub(super) const MOST: f64 = 100_000.0;

/// Why the arms did not step. No time has passed for any of them.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum StepError {
    /// A target is out of range or not a number.
    #[error("arm {arm}, joint {joint}: {degrees} is out of range: use 0 to 180 degrees")]
    Target {
        /// The number of the arm, from 0.
        arm: usize,
        /// The number of the joint, from 1.
        joint: usize,
        /// The target: not a number from 0 to 180.
        degrees: f64,
    },
    /// A measurement of another simulation is not a number, or far too large.
    #[error(
        "arm {arm}, joint {joint}: a measurement of {value} is out of range: use -{MOST} to {MOST}, or NaN as the position of a \
         joint that is simulated here"
    )]
    Measured {
        /// The number of the arm, from 0.
        arm: usize,
        /// The number of the joint, from 1.
        joint: usize,
        /// The measurement in its unit: not a number, or beyond 100 000 either way.
        value: f64,
    },
    /// The time of an exchange is not 1 to 1000 whole milliseconds.
    #[error("an exchange for {} s: use 0.001 to 1 s in whole milliseconds", .0.as_secs_f64())]
    ExchangeTime(Duration),
    /// The time of a step is not 5 to 1000 whole milliseconds.
    #[error("a step of {} s: use 0.005 to 1 s in whole milliseconds", .0.as_secs_f64())]
    Time(Duration),
    /// A slice has another length than the arms need.
    #[error("{given} numbers: {wanted} are needed")]
    Length {
        /// The length of the slice.
        given: usize,
        /// What the arms need.
        wanted: usize,
    },
}
