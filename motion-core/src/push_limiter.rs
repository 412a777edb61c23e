//! Keeps one joint from pushing harder than its limit ([D27](protocol_core::decisions#d27)).
//!
//! ```text
//!            over the limit for longer than its grace
//!   Free ──────────────────────────────────────────────────────────▶ Limiting
//!    ▲                                                                  │
//!    └── clearly under the limit, and the set-point needs no bound ─────┘
//! ```
//!
//! A servo pushes in proportion to the distance of its goal. So a limited joint keeps its set-point within a distance of
//! the measured position, and this distance is scaled by limit / push until the push is the limit. The stiffness of the
//! servo need not be known. A servo at full load is the exception: its push does not depend on the distance, so an assumed
//! stiffness bounds the distance first. Push is in 0.1 % of the stall torque, positive towards greater angles. This file
//! does not know registers, targets or the bus.

use protocol_core::time::{Duration, Instant};

use crate::calibration::MicroDegrees;

/// The limit of a joint's push.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PushLimit {
    /// The limit of a joint that is not a claw, in 0.1 % of the stall torque.
    Arm(i16),
    /// The limit of the claw, in 0.1 % of the stall torque. The claw carries no load, but may break what it holds.
    Grip(i16),
}

impl PushLimit {
    const fn permille(self) -> i16 {
        let (Self::Arm(permille) | Self::Grip(permille)) = self;
        permille
    }

    /// How long a turning joint, and a joint at a standstill, may exceed the limit. [D27](protocol_core::decisions#d27)
    /// allows 300 ms. A joint of the arm that reverses at full speed with 300 g exceeds it for up to 270 ms, because it
    /// brakes and accelerates with the same push. A joint at a standstill begins to turn within 80 ms unless it is
    /// blocked.
    const fn grace(self) -> [Duration; 2] {
        match self {
            Self::Arm(_) => [Duration::from_millis(280), Duration::from_millis(80)],
            Self::Grip(_) => [Duration::from_millis(50), Duration::from_millis(30)],
        }
    }
}

/// A joint that turns by at most one count is at a standstill: 0.29 degrees of joints 5 to 7. In millionths of a degree.
const STANDSTILL: u32 = 300_000;
/// The assumed distance of the goal from which on a servo gives its full load. It bounds the distance as long as the servo is
/// at full load: 4.3 degrees, as arm-sim assumes.
const FULL_LOAD_DISTANCE: i32 = 4_300_000;
/// A servo with this load or more, in 0.1 %, may be at full load.
pub(crate) const FULL_LOAD: i16 = 950;
/// How far the push may exceed the limit while a joint sinks slowly ([D27](protocol_core::decisions#d27)).
const TOLERANCE: i16 = 50;
/// The highest speed at which the bound retreats while the push is within the tolerance, in micro-degrees per millisecond.
/// Goals are whole counts, so with 8 degrees/s the joint sinks at 10 degrees/s at most ([D27](protocol_core::decisions#d27)).
const SINK_PER_MILLISECOND: i32 = 8_000;
/// The distance may grow again when the push is this far under the limit; with a limit under twice this, when the push
/// is under half the limit.
const SLACK: i16 = 100;
/// How much the distance grows after an average push that is low enough ([`SLACK`]), in millionths of a degree.
const GROWTH: i32 = 100_000;
/// Measurements in an average. The push follows a new goal after two measurements.
const AVERAGED: i16 = 3;

/// A measurement of a joint, as its limiter needs it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PushSample {
    /// The measured position of the joint.
    pub angle: MicroDegrees,
    /// The load less what the speed needs, in 0.1 % of the stall torque.
    pub push: i16,
    /// The servo may be at full load, so its load does not tell how far away its goal is.
    pub is_saturated: bool,
}

/// The push limiter of one joint.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PushLimiter {
    phase: Phase,
}

#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Phase {
    Free,
    /// The push is over the limit.
    Over {
        since: Instant,
        /// Since when the joint stands still, and its angle then.
        still: (Instant, MicroDegrees),
        is_positive: bool,
    },
    Limiting(Bound),
}

/// How far the set-point may go in the direction of the push.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Bound {
    is_positive: bool,
    /// The allowed distance between measured position and set-point, in millionths of a degree.
    distance: i32,
    set_point: MicroDegrees,
    measured_at: Instant,
    /// The sum and the number of the pushes in the present average.
    sum: i32,
    samples: i16,
    /// The servo may have been at full load in one of these measurements.
    any_saturated: bool,
    /// The push is over the tolerance, so the bound follows the measured position at once.
    is_urgent: bool,
    /// The set-point of the last control cycle was beyond the bound.
    is_holding_back: bool,
}

impl PushLimiter {
    /// A joint that nothing holds back.
    pub const FREE: Self = Self { phase: Phase::Free };

    /// Takes a measurement of a driven joint. Returns whether the joint is limited, and has turned past `set_point` in
    /// the direction of its push. Then no obstacle stops the joint, and the servo would turn it back to this set-point.
    #[inline]
    pub fn measured(
        &mut self,
        now: Instant,
        sample: PushSample,
        set_point: MicroDegrees,
        limit: PushLimit,
    ) -> bool {
        let is_over = sample.push.saturating_abs() > limit.permille();
        if !is_over && matches!(self.phase, Phase::Free) {
            return false;
        }
        self.follow(now, sample, set_point, limit);
        self.is_passed(set_point, sample.angle)
    }

    fn is_passed(&self, set_point: MicroDegrees, angle: MicroDegrees) -> bool {
        let Phase::Limiting(bound) = &self.phase else { return false };
        if bound.is_positive { angle > set_point } else { angle < set_point }
    }

    // Not inlined: few measurements call it, but if it were inlined, all would save the CPU registers that it uses.
    #[inline(never)]
    fn follow(&mut self, now: Instant, sample: PushSample, set_point: MicroDegrees, limit: PushLimit) {
        let [grace, grace_at_standstill] = limit.grace();
        let limit = limit.permille();
        match &mut self.phase {
            Phase::Free => {
                let is_positive = sample.push > 0;
                self.phase = Phase::Over { since: now, still: (now, sample.angle), is_positive };
            }
            Phase::Over { since, still, is_positive } => {
                if directed(sample.push, *is_positive) <= limit {
                    self.phase = Phase::Free;
                    return;
                }
                let (still_since, at) = still;
                if at.0.abs_diff(sample.angle.0) > STANDSTILL {
                    (*still_since, *at) = (now, sample.angle);
                }
                if now - *since >= grace || now - *still_since >= grace_at_standstill {
                    let bound = Bound::new(now, sample, set_point, limit);
                    self.phase = Phase::Limiting(bound);
                }
            }
            Phase::Limiting(bound) => {
                if !bound.measured(now, sample, limit) {
                    self.phase = Phase::Free;
                }
            }
        }
    }

    /// The set-point that a joint has to keep instead of `set_point`; `None` if it may go there. Call it in each control
    /// cycle.
    pub fn hold_back(&mut self, set_point: MicroDegrees) -> Option<MicroDegrees> {
        let Phase::Limiting(bound) = &mut self.phase else { return None };
        let ahead = if bound.is_positive { set_point > bound.set_point } else { set_point < bound.set_point };
        bound.is_holding_back = ahead;
        ahead.then_some(bound.set_point)
    }

    /// Is there a bound for the set-point now, whether or not it holds the set-point back?
    #[must_use]
    pub const fn is_limiting(&self) -> bool {
        matches!(self.phase, Phase::Limiting(_))
    }
}

impl Bound {
    fn new(now: Instant, sample: PushSample, set_point: MicroDegrees, limit: i16) -> Self {
        let is_positive = sample.push > 0;
        let error = directed_angle(set_point.0.saturating_sub(sample.angle.0), is_positive).max(0);
        let push = sample.push.saturating_abs();
        let distance = scaled(error, limit, push);
        let mut bound = Self {
            is_positive,
            distance: if sample.is_saturated { distance.min(distance_at(limit)) } else { distance },
            set_point,
            measured_at: now,
            sum: 0,
            samples: 0,
            any_saturated: false,
            is_urgent: push > limit + TOLERANCE,
            is_holding_back: true,
        };
        bound.follow(now, sample.angle);
        bound
    }

    /// Takes a measurement: adapts the distance after each average, and moves the bound. Returns whether the joint still has
    /// to be limited.
    fn measured(&mut self, now: Instant, sample: PushSample, limit: i16) -> bool {
        self.sum += i32::from(directed(sample.push, self.is_positive));
        self.samples += 1;
        self.any_saturated |= sample.is_saturated;
        if self.samples == AVERAGED {
            let average = i16::try_from(self.sum / i32::from(AVERAGED)).unwrap_or(i16::MAX);
            (self.sum, self.samples) = (0, 0);
            let was_saturated = core::mem::take(&mut self.any_saturated);
            self.is_urgent = average > limit + TOLERANCE;
            let is_low = average < limit - SLACK.min(limit / 2);
            if is_low && !self.is_holding_back {
                return false;
            }
            if average > limit {
                self.distance = scaled(self.distance, limit, average);
            } else if is_low {
                self.distance = self.distance.saturating_add(GROWTH);
            }
            if was_saturated {
                self.distance = self.distance.min(distance_at(limit));
            }
        }
        self.follow(now, sample.angle);
        true
    }

    /// Moves the bound with the measured position. While the push is within the tolerance, the bound retreats at most
    /// at the sink speed.
    fn follow(&mut self, now: Instant, angle: MicroDegrees) {
        let reach = directed_angle(self.distance, self.is_positive);
        let ahead = directed_angle(angle.0.saturating_add(reach) - self.set_point.0, self.is_positive);
        let millis = i32::try_from((now - self.measured_at).as_micros() / 1_000).unwrap_or(1_000).min(1_000);
        let least = if self.is_urgent { i32::MIN } else { -SINK_PER_MILLISECOND * millis };
        self.set_point.0 += directed_angle(ahead.max(least), self.is_positive);
        self.measured_at = now;
    }
}

/// The distance at which a servo with the assumed stiffness pushes as hard as the limit.
fn distance_at(limit: i16) -> i32 {
    FULL_LOAD_DISTANCE / 1_000 * i32::from(limit)
}

/// `distance` × limit / push, for a push over the limit.
fn scaled(distance: i32, limit: i16, push: i16) -> i32 {
    (distance / i32::from(push.max(1))).saturating_mul(limit.into())
}

/// A push with its sign changed unless `is_positive`, so that it counts in the direction of the bound.
const fn directed(push: i16, is_positive: bool) -> i16 {
    if is_positive { push } else { push.saturating_neg() }
}

/// An angle with its sign changed unless `is_positive`, so that it counts in the direction of the bound. Applied again, the
/// function gives the angle back.
const fn directed_angle(angle: i32, is_positive: bool) -> i32 {
    if is_positive { angle } else { angle.saturating_neg() }
}
