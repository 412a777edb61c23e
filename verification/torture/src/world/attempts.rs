//! Counts how often a joint is given torque. A joint that was let go gets torque again at most three times in a minute, then not
//! until register 29 is written (D28).

use protocol_core::time::{Duration, Instant};

/// A joint is given torque again at most [`MAX_ATTEMPTS`] times in this time.
const WINDOW: Duration = Duration::from_millis(60_000);
/// [`WINDOW`] less a margin for the time from a decision of the controller to its torque command.
const WINDOW_OF_ORDERS: Duration = Duration::from_millis(57_000);
/// See [`WINDOW`].
const MAX_ATTEMPTS: usize = 3;

/// The times at which a joint was given torque since register 29 was written.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EngagementAttempts {
    /// The latest first.
    at: [Option<Instant>; MAX_ATTEMPTS],
    /// The times at which the joint was given torque after it had certainly been let go, the latest first.
    after_let_go: [Option<Instant>; MAX_ATTEMPTS],
    /// True once all times in `at` were within one window.
    pub(super) is_exhausted: bool,
}

impl EngagementAttempts {
    /// Adds an engagement: the joint is given torque.
    pub(super) fn add(&mut self, now: Instant) {
        self.at.rotate_right(1);
        self.at.first_mut().into_iter().for_each(|first| *first = Some(now));
        self.is_exhausted |= self.at.iter().all(|at| at.is_some_and(|at| now - at < WINDOW));
    }

    /// Adds an engagement after the joint had certainly been let go. Returns true if it is one too many within the window.
    pub(super) fn add_after_let_go(&mut self, now: Instant) -> bool {
        let [first, second, third] = self.after_let_go;
        self.after_let_go = [Some(now), first, second];
        third.is_some_and(|at| now - at < WINDOW_OF_ORDERS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fourth_attempt_in_a_minute_is_one_too_many() {
        for (seconds, is_too_often) in [([0, 10, 20, 56], true), ([0, 10, 20, 58], false)] {
            let mut attempts = EngagementAttempts::default();
            let found =
                seconds.map(|second| attempts.add_after_let_go(Instant::from_micros(second * 1_000_000)));
            assert_eq!(found, [false, false, false, is_too_often]);
        }
    }
}
