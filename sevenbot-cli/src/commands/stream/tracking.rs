//! How far the measured positions are from the points of the stream.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use sevenbot::FineAngle;
use sevenbot::fine::FineTargets;

/// How long points are kept: longer than the largest delay, 1.5 periods of 1 s.
const KEPT: Duration = Duration::from_secs(2);
/// In degrees. A target that is farther than this from the last point was not written by this stream.
const ELSEWHERE: f64 = 3.0;

/// The points that were sent, and the errors so far.
#[derive(Debug)]
pub(super) struct Tracking {
    /// The time from sending a point until the joints should be there.
    delay: Duration,
    sent: VecDeque<(Instant, [f64; 7])>,
    pose: [f64; 7],
    squares: f64,
    count: u32,
    largest: (f64, u8),
}

/// The error of the positions, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TrackingError {
    /// Root mean square over joints and reports.
    pub(super) rms: f64,
    pub(super) largest: f64,
    /// The joint with the largest error, from 1.
    pub(super) joint: u8,
}

impl Tracking {
    /// Begins with the targets at the start. The arm is at a point one and a half periods after the point came (D23).
    pub(super) fn new(targets: [FineAngle; 7], period: Duration) -> Self {
        let pose = targets.map(FineAngle::degrees);
        let (sent, delay) = (VecDeque::new(), period * 3 / 2);
        Self { delay, sent, pose, squares: 0.0, count: 0, largest: (0.0, 1) }
    }

    /// Adds a point that was sent.
    pub(super) fn add_point(&mut self, now: Instant, point: &FineTargets) {
        for (degrees, angle) in self.pose.iter_mut().zip(point) {
            *degrees = angle.map_or(*degrees, FineAngle::degrees);
        }
        self.sent.push_back((now, self.pose));
        while self.sent.front().is_some_and(|(time, _)| *time + KEPT < now) {
            self.sent.pop_front();
        }
    }

    /// The last point of each joint, in degrees; the target at the start where it had none.
    pub(super) const fn pose(&self) -> [f64; 7] {
        self.pose
    }

    /// The first joint whose target in `targets` is more than 3 degrees from its last point (or its target at the start): its
    /// number, the expected and the present target in degrees.
    pub(super) fn moved_from_outside(&self, targets: [f64; 7]) -> Option<(u8, f64, f64)> {
        let joints = (1..).zip(self.pose).zip(targets).map(|((joint, from), to)| (joint, from, to));
        joints.into_iter().find(|(_, from, to)| (from - to).abs() > ELSEWHERE)
    }

    /// Adds the error of measured positions, if it is known which pose was due.
    pub(super) fn add_measured(&mut self, received: Instant, positions: &FineTargets) {
        let Some(expected) = received.checked_sub(self.delay).and_then(|time| self.at(time)) else { return };
        for ((expected, measured), joint) in expected.iter().zip(positions).zip(1..) {
            let Some(measured) = measured else { continue };
            let error = (measured.degrees() - expected).abs();
            self.squares += error * error;
            self.count = self.count.saturating_add(1);
            if error > self.largest.0 {
                self.largest = (error, joint);
            }
        }
    }

    /// The error so far; `None` before the first report for which it is known which pose was due.
    pub(super) fn error(&self) -> Option<TrackingError> {
        let (largest, joint) = self.largest;
        let rms = (self.squares / f64::from(self.count)).sqrt();
        (self.count > 0).then_some(TrackingError { rms, largest, joint })
    }

    /// The interpolated pose at this time; `None` before the first point and after the last.
    fn at(&self, time: Instant) -> Option<[f64; 7]> {
        let pairs = self.sent.iter().zip(self.sent.iter().skip(1));
        let ((from_time, from), (to_time, to)) =
            pairs.rev().find(|((from, _), (to, _))| *from <= time && time <= *to)?;
        let whole = to_time.saturating_duration_since(*from_time).as_secs_f64();
        let share = time.saturating_duration_since(*from_time).as_secs_f64() / whole.max(f64::EPSILON);
        let mut pose = *from;
        for (degrees, to) in pose.iter_mut().zip(to) {
            *degrees += (to - *degrees) * share;
        }
        Some(pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_taken_against_the_point_that_is_due() {
        let (start, period) = (Instant::now(), Duration::from_millis(20));
        let at = |millis| start + Duration::from_millis(millis);
        let pose = |degrees| [FineAngle::from_degrees(degrees); 7];
        let mut tracking =
            Tracking::new([90.0; 7].map(|it| FineAngle::from_degrees(it).expect("an angle")), period);
        assert_eq!(tracking.error(), None);
        for tick in 0..5_u8 {
            tracking.add_point(at(u64::from(tick) * 20), &pose(90.0 + f64::from(tick)));
        }
        tracking.add_measured(at(10), &pose(120.0));
        assert_eq!(tracking.error(), None, "nothing was due yet");
        tracking.add_measured(at(30 + 50), &pose(92.5));
        assert_eq!(tracking.error(), Some(TrackingError { rms: 0.0, largest: 0.0, joint: 1 }));
        let mut late = pose(92.5);
        late[2] = FineAngle::from_degrees(93.5);
        tracking.add_measured(at(30 + 50), &late);
        let error = tracking.error().expect("reports");
        assert_eq!((error.largest, error.joint), (1.0, 3));
        assert!((error.rms - (1.0_f64 / 14.0).sqrt()).abs() < 1e-9, "{error:?}");
    }
}
