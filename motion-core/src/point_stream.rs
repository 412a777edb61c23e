//! The schedule of a stream of points for one joint ([D23](protocol_core::decisions#d23)).
//!
//! ```text
//!   frames of the host     │k      │k+1   │k+2        │k+3      each up to half a period early or late
//!   points are due               │k-1     │k      │k+1     │k+2   an even grid, one and a half periods later
//! ```
//!
//! The points are due on a grid of one period, so the joint moves evenly although the frames do not come evenly. Each
//! frame shifts the grid a little towards one and a half periods after itself: the grid follows the host's clock. A
//! point is due two periods after its frame at the latest. This file does not know the joint or its speed.

use heapless::Vec;
use protocol_core::time::{Duration, Instant};

use crate::CYCLE;
use crate::calibration::MicroDegrees;

/// A stream needs three points; one more may be due within the present control cycle.
const CAPACITY: usize = 4;
/// A frame shifts the grid by 1/16 of the distance between the grid and the time one and a half periods after the frame.
const SHIFT_DIVISOR: u64 = 16;

/// If a frame comes later than 1/8 of a period after the newest point was due, the frame before it counts as lost.
const LATE_DIVISOR: u64 = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct DuePoint {
    due: Instant,
    angle: MicroDegrees,
}

/// The points of a stream that the joint has not passed yet.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PointStream {
    /// The oldest first.
    points: Vec<DuePoint, CAPACITY>,
    /// When the newest point is or was due.
    last_due: Instant,
}

impl PointStream {
    /// No points and no grid: the next point begins a new stream.
    pub const NONE: Self = Self { points: Vec::new(), last_due: Instant::ZERO };

    /// Forgets the points and their grid: the next point begins a new stream.
    pub fn end(&mut self) {
        self.points.clear();
        self.last_due = Instant::ZERO;
    }

    /// Has the joint passed all points?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Adds the point whose frame came at `now`. Points that are due at the same time or later are passed over, and so is
    /// the oldest point if there is no room.
    pub fn push(&mut self, now: Instant, period: Duration, angle: MicroDegrees) {
        let due = self.due(now, period);
        while self.points.last().is_some_and(|point| point.due >= due) {
            self.points.pop();
        }
        if self.points.is_full() {
            self.pass(1);
        }
        // There is room.
        let _ = self.points.push(DuePoint { due, angle });
        self.last_due = due;
    }

    /// When the point is due whose frame came at `now`.
    fn due(&self, now: Instant, period: Duration) -> Instant {
        let wanted = now + period + part(period, 2);
        let latest = now + period + period;
        if now > self.last_due + period {
            return wanted; // A new stream.
        }
        let slot = self.last_due + period;
        // The joint has waited longer than it would for a late frame: the frame before this one was lost.
        let slot = if now > self.last_due + part(period, LATE_DIVISOR) { slot + period } else { slot };
        let late = part(wanted - slot, SHIFT_DIVISOR);
        let early = part(slot - wanted, SHIFT_DIVISOR);
        latest.min(earlier(slot + late, early))
    }

    /// The angle at `end` for a joint that was at `from` one control cycle earlier. Removes the points that are due by `end`.
    pub fn follow(&mut self, from: MicroDegrees, end: Instant) -> MicroDegrees {
        let (mut angle, mut time) = (from, earlier(end, CYCLE));
        while let Some(next) = self.points.first() {
            if next.due > end {
                return between(angle, next.angle, end - time, next.due - time);
            }
            (angle, time) = (next.angle, time.max(next.due));
            self.pass(1);
        }
        angle
    }

    /// Passes over all points but the newest.
    pub fn skip_to_newest(&mut self) {
        self.pass(self.points.len().saturating_sub(1));
    }

    /// Removes the oldest points.
    fn pass(&mut self, count: usize) {
        let left = self.points.get(count..).unwrap_or(&[]);
        self.points = Vec::from_slice(left).unwrap_or_default();
    }
}

fn part(time: Duration, divisor: u64) -> Duration {
    Duration::from_micros(time.as_micros().checked_div(divisor).unwrap_or(0))
}

fn earlier(time: Instant, by: Duration) -> Instant {
    Instant::from_micros(time.as_micros().saturating_sub(by.as_micros()))
}

/// The angle after `passed` of the `whole` time on the straight line between two angles.
fn between(from: MicroDegrees, to: MicroDegrees, passed: Duration, whole: Duration) -> MicroDegrees {
    let micros = |time: Duration| i64::try_from(time.as_micros()).unwrap_or(i64::MAX);
    let distance = i64::from(to.0) - i64::from(from.0);
    let part = distance.saturating_mul(micros(passed)).checked_div(micros(whole)).unwrap_or(0);
    MicroDegrees(from.0.saturating_add(i32::try_from(part).unwrap_or(0)))
}
