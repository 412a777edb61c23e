//! How often a joint was given torque: after three times in a minute it gets none until register 29 is written (D28).

use protocol_core::time::{Duration, Instant};

/// A joint is given torque again at most [`MAX_ATTEMPTS`] times in this time.
const WINDOW: Duration = Duration::from_millis(60_000);
/// See [`WINDOW`].
const MAX_ATTEMPTS: usize = 3;

/// The times at which a joint was given torque since register 29 was written.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EngagementAttempts {
    /// The latest first.
    at: [Option<Instant>; MAX_ATTEMPTS],
    /// True once all of them were within the window.
    pub(super) is_exhausted: bool,
}

impl EngagementAttempts {
    /// The joint is given torque.
    pub(super) fn add(&mut self, now: Instant) {
        self.at.rotate_right(1);
        self.at.first_mut().into_iter().for_each(|first| *first = Some(now));
        self.is_exhausted |= self.at.iter().all(|at| at.is_some_and(|at| now - at < WINDOW));
    }
}
