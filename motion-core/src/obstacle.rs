//! What an obstacle does to one joint: it holds the set-point back, and after a second the joint counts as blocked
//! ([D27](protocol_core::decisions#d27)).
//!
//! This file does not know registers or the bus.

use protocol_core::time::{Duration, Instant};

use crate::calibration::MicroDegrees;
use crate::push_limiter::{PushLimit, PushLimiter, PushSample};

/// A joint that is held back for this long, and comes no nearer to its target, is blocked. A blocked joint tries again for this
/// long after each point of a stream.
const BLOCKED_AFTER: Duration = Duration::from_millis(1_000);
/// [`BLOCKED_AFTER`] in control cycles of 10 ms.
const BLOCKED_AFTER_CYCLES: u8 = 100;
/// A joint counts as nearer to its target only if its distance became smaller by more than this, in millionths of a degree.
/// One count is 0.29 degrees for joints 5 to 7.
const NEARER_BY: u32 = 300_000;

/// The set-point of a joint that an obstacle holds back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HeldBack {
    pub(crate) set_point: MicroDegrees,
    /// The joint is blocked and does not retry, so its set-point becomes its target.
    pub(crate) ends_move: bool,
}

#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct ObstacleWatch {
    limiter: PushLimiter,
    /// For how many control cycles the joint has been held back without coming nearer to its target, and its distance
    /// from the target when these cycles began, in millionths of a degree. The time of a late call does not count: the joint
    /// was neither measured nor driven meanwhile.
    held: Option<(u8, u32)>,
    is_blocked: bool,
    /// When the last point of a stream came, if the joint is blocked and tries to reach it.
    retrying_since: Option<Instant>,
}

impl ObstacleWatch {
    pub(crate) const NONE: Self =
        Self { limiter: PushLimiter::FREE, held: None, is_blocked: false, retrying_since: None };

    /// Stops holding back the set-point. A blocked joint stays blocked until the next target for it.
    #[inline(never)]
    pub(crate) fn release(&mut self) {
        *self = Self { is_blocked: self.is_blocked, ..Self::NONE };
    }

    /// Forgets the obstacle, and that the joint is blocked.
    pub(crate) fn forget(&mut self) {
        self.is_blocked = false;
        self.release();
    }

    /// Was the set-point held back in the last control cycle?
    pub(crate) const fn is_holding_back(&self) -> bool {
        self.held.is_some()
    }

    /// Is the joint blocked, so that register 195 shows its bit?
    pub(crate) const fn is_blocked(&self) -> bool {
        self.is_blocked
    }

    /// Takes a measurement. Returns whether the joint has turned past the set-point that was held back in the last control
    /// cycle. See [`PushLimiter::measured`].
    pub(crate) fn measured(
        &mut self,
        now: Instant,
        sample: PushSample,
        set_point: MicroDegrees,
        limit: PushLimit,
    ) -> bool {
        self.limiter.measured(now, sample, set_point, limit) && self.is_holding_back()
    }

    /// Records that the host wrote a target: the joint tries again.
    pub(crate) const fn target_written(&mut self) {
        (self.held, self.is_blocked, self.retrying_since) = (None, false, None);
    }

    /// Records that the host wrote a point of a stream at `now`: a blocked joint tries again, and counts as blocked until it
    /// is free.
    pub(crate) fn point_written(&mut self, now: Instant) {
        self.retrying_since = self.is_blocked.then_some(now);
    }

    /// Checks the set-point of the control cycle that ends at `end`, of a joint measured at `angle`. If the set-point is
    /// held back, returns the set-point that replaces it.
    pub(crate) fn hold_back(
        &mut self,
        end: Instant,
        set_point: MicroDegrees,
        target: MicroDegrees,
        angle: MicroDegrees,
    ) -> Option<HeldBack> {
        let Some(set_point) = self.limiter.hold_back(set_point) else {
            self.held = None;
            if self.retrying_since.is_some() && !self.limiter.is_limiting() {
                self.target_written();
            }
            return None;
        };
        let distance = target.0.abs_diff(angle.0);
        let (cycles, nearest) = self.held.get_or_insert((0, distance));
        if distance.saturating_add(NEARER_BY) < *nearest {
            (*cycles, *nearest) = (0, distance);
        } else if *cycles >= BLOCKED_AFTER_CYCLES {
            self.is_blocked = true;
        } else {
            *cycles += 1;
        }
        let is_trying = self.retrying_since.is_some_and(|since| end - since < BLOCKED_AFTER);
        Some(HeldBack { set_point, ends_move: self.is_blocked && !is_trying })
    }
}
