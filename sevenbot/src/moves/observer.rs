//! Observers of a call that takes a while.

use std::time::Duration;

use crate::arm::Arm;

/// What a call does at the moment, and the unit of its progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Joints move to their targets. In degrees, summed over these joints.
    Moving,
    /// The joints have nearly arrived. In degrees.
    Settling,
    /// A recording, or the way to a first point, is played. In points.
    Playing,
}

impl Stage {
    /// The unit in [`Observer::progress`]: `degrees` or `points`.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Moving | Self::Settling => "degrees",
            Self::Playing => "points",
        }
    }
}

/// Observes a call that takes a while, and may end it. `()` does neither.
///
/// ```
/// use sevenbot::moves::{Observer, Stage};
///
/// struct ForAtMost(u32);
/// impl Observer for ForAtMost {
///     fn goes_on(&mut self) -> bool {
///         self.0 = self.0.saturating_sub(1);
///         self.0 > 0
///     }
/// }
/// let mut watch = ForAtMost(2);
/// watch.progress(Stage::Moving, 10, 90);
/// assert!(watch.goes_on() && !watch.goes_on());
/// ```
pub trait Observer {
    /// Does the call go on? Asked between reads, with waits of at most 50 ms besides the reads. `false` ends the call with
    /// [`MoveError::Interrupted`](super::MoveError).
    fn goes_on(&mut self) -> bool {
        true
    }

    /// `done` of `total` units of this stage are done.
    fn progress(&mut self, stage: Stage, done: u64, total: u64) {
        let _ = (stage, done, total);
    }

    /// Waits between two reads of an arm that moves. An implementation may use the arm for short reads meanwhile.
    fn pause(&mut self, arm: &mut Arm, time: Duration) {
        arm.sleep(time);
    }
}

impl Observer for () {}
