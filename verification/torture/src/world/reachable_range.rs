//! The goals that a joint can reach at the allowed speed (D10).

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

/// One count in the unit of the arithmetic here, 1e-9 counts.
const NANOCOUNTS: i64 = 1_000_000_000;
/// Two control cycles: a set-point makes up for one cycle after a late wake-up, and the present cycle may be incomplete.
const SLACK: Duration = Duration::from_millis(20);
/// Rounding to whole counts at both ends of a move.
const ROUNDING: i64 = NANOCOUNTS + NANOCOUNTS / 100;

/// The range of goals that a joint can reach.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReachableRange {
    /// Bounds in 1e-9 counts. They move outwards at the allowed speed, and each goal limits them again.
    upper: i64,
    lower: i64,
    pub(super) last_goal: u16,
    speed: i64,
    at: Instant,
}

impl ReachableRange {
    /// The range of a joint at its goal. `speed` is the value of its speed register.
    pub(super) fn at(joint: Joint, goal: u16, speed: u8, now: Instant) -> Self {
        let position = i64::from(goal) * NANOCOUNTS;
        Self { upper: position, lower: position, last_goal: goal, speed: limit(joint, speed), at: now }
    }

    /// Allows a written speed until the next goal, even if another write replaces it.
    pub(super) fn allow_speed(&mut self, joint: Joint, speed: u8) {
        self.speed = self.speed.max(limit(joint, speed));
    }

    /// Adds a count at both ends, for set-points that are computed again from whole counts.
    pub(super) fn widen(&mut self) {
        self.upper += NANOCOUNTS;
        self.lower -= NANOCOUNTS;
    }

    /// The range of a joint whose set-point stood still until now, except for the time `ahead` after the last goal.
    pub(super) fn resumed(self, now: Instant, ahead: Duration) -> Self {
        let moved = (now - self.at).min(ahead);
        Self { at: Instant::from_micros(now.as_micros().saturating_sub(moved.as_micros())), ..self }
    }

    /// The range of a set-point that may have come nearer to this position at any speed, because the joint gives way.
    pub(super) fn giving_way(self, position: u16) -> Self {
        let [position, goal] = [position, self.last_goal].map(|counts| i64::from(counts) * NANOCOUNTS);
        let (upper, lower) = (self.upper.max(position).max(goal), self.lower.min(position).min(goal));
        Self { upper, lower, ..self }
    }

    /// The range after the next goal; `None` if that goal is out of reach.
    pub(super) fn after(self, joint: Joint, goal: u16, speed: u8, now: Instant) -> Option<Self> {
        let next = Self::at(joint, goal, speed, now);
        let position = next.upper;
        let fastest = next.speed.max(self.speed);
        let moved = fastest * micros(now - self.at);
        let tolerance = fastest * micros(SLACK) + ROUNDING;
        let (upper, lower) = (self.upper + moved, self.lower - moved);
        if position > upper + tolerance || position < lower - tolerance {
            return None;
        }
        // The range of a higher speed does not apply to a lower one.
        let is_slower = next.speed < self.speed;
        Some(if is_slower {
            next
        } else {
            Self { upper: upper.min(position), lower: lower.max(position), ..next }
        })
    }
}

fn micros(time: Duration) -> i64 {
    i64::try_from(time.as_micros()).unwrap_or(i64::MAX).min(10_000_000)
}

/// The speed limit in 1e-9 counts per microsecond, rounded up. A unit of the speed register is 1.9 degrees/s. The value
/// 0 means 372 degrees/s.
fn limit(joint: Joint, speed: u8) -> i64 {
    let tenths = if speed == 0 { 3_720 } else { i64::from(speed) * 19 };
    tenths * counts_per_half_turn(joint) * 100 / 180 + 1
}

fn counts_per_half_turn(joint: Joint) -> i64 {
    if joint.number() < 5 { 850 } else { 625 }
}
