//! The set-point that is due at a time: straight lines between the points of the input.

use std::collections::VecDeque;
use std::time::Duration;

use sevenbot::FineAngle;
use sevenbot::fine::FineTargets;

use super::input::TimedPoint;

/// The most points that wait. A usual input has far fewer in one period of the stream.
const POINTS_AHEAD: usize = 16_384;

/// The points that are not sent yet, and the last one whose time has come.
#[derive(Debug, Default)]
pub(super) struct Feed {
    last: Option<TimedPoint>,
    /// Has `take` returned the last point itself, because no later one was there?
    is_last_taken: bool,
    next: VecDeque<TimedPoint>,
}

impl Feed {
    /// Adds a point. Its time must be later than the times of all earlier points.
    pub(super) fn push(&mut self, point: TimedPoint) {
        self.next.push_back(point);
    }

    /// False if enough points wait. Without this limit, a program that writes faster than the arm moves would fill the memory.
    pub(super) fn has_room(&self) -> bool {
        self.next.len() < POINTS_AHEAD
    }

    /// True if all points have been taken by [`Feed::take`].
    pub(super) fn is_empty(&self) -> bool {
        self.next.is_empty()
    }

    /// The time at which the stream goes on after a pause: one period after the last point, or at the next point if that is
    /// earlier.
    pub(super) fn resume_time(&self, period: Duration) -> Duration {
        let next = self.next.front().map_or(Duration::ZERO, |next| next.time);
        self.last.map_or(next, |last| next.min(last.time + period))
    }

    /// The set-point at this time; `None` before the time of the first point, or if no new point has come since the last one was
    /// returned.
    pub(super) fn take(&mut self, time: Duration) -> Option<FineTargets> {
        while let Some(point) = self.next.pop_front_if(|point| point.time <= time) {
            (self.last, self.is_last_taken) = (Some(point), false);
        }
        let last = self.last?;
        let Some(next) = self.next.front() else {
            let is_new = !std::mem::replace(&mut self.is_last_taken, true);
            return is_new.then_some(last.joints);
        };
        let share = (time.saturating_sub(last.time)).as_secs_f64() / (next.time - last.time).as_secs_f64();
        Some(between(&last.joints, &next.joints, share))
    }
}

/// Interpolates between two set-points; `share` is 0 at `from` and 1 at `to`. A joint that has no angle in one of them keeps
/// its value of `from`.
fn between(from: &FineTargets, to: &FineTargets, share: f64) -> FineTargets {
    let mut joints = *from;
    for (joint, to) in joints.iter_mut().zip(to) {
        *joint = joint.map(|from: FineAngle| to.map_or(from, |to| from.between(to, share)));
    }
    joints
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(20);

    fn feed(points: &[(u64, u16)]) -> Feed {
        let mut feed = Feed::default();
        for &(millis, hundredths) in points {
            let joints = [FineAngle::from_hundredths(hundredths), None, None, None, None, None, None];
            feed.push(TimedPoint { time: Duration::from_millis(millis), joints });
        }
        feed
    }

    fn taken(feed: &mut Feed, millis: u64) -> Option<u16> {
        feed.take(Duration::from_millis(millis)).map(|joints| joints[0].map_or(0, FineAngle::hundredths))
    }

    #[test]
    fn points_far_apart_are_joined_by_straight_lines() {
        let mut feed = feed(&[(0, 9_000), (100, 9_100), (150, 9_000)]);
        let points: Vec<_> = (0..=8).map(|tick| taken(&mut feed, tick * 20)).collect();
        let expected = [9_000, 9_020, 9_040, 9_060, 9_080, 9_100, 9_060, 9_020, 9_000];
        assert_eq!(points, expected.map(Some), "the end is sent although no tick meets its time");
        assert_eq!(taken(&mut feed, 180), None);
    }

    #[test]
    fn points_nearer_than_the_period_are_passed_over() {
        let mut feed = feed(&[(0, 9_000), (5, 9_500), (10, 9_600), (20, 9_100)]);
        assert_eq!([taken(&mut feed, 0), taken(&mut feed, 20)], [Some(9_000), Some(9_100)]);
    }

    #[test]
    fn after_a_pause_the_next_point_takes_one_period() {
        let mut feed = feed(&[(0, 9_000)]);
        assert_eq!(feed.resume_time(PERIOD), Duration::ZERO);
        assert_eq!([taken(&mut feed, 0), taken(&mut feed, 20)], [Some(9_000), None]);
        feed.push(TimedPoint { time: PERIOD, joints: [FineAngle::from_hundredths(9_010); 7] });
        assert_eq!(feed.resume_time(PERIOD), PERIOD);
        assert_eq!(taken(&mut feed, 20), Some(9_010));
        feed.push(TimedPoint { time: PERIOD * 6, joints: [FineAngle::from_hundredths(9_110); 7] });
        assert_eq!(feed.resume_time(PERIOD), PERIOD * 2);
        assert_eq!(taken(&mut feed, 40), Some(9_030), "the way is not shortened");
    }

    #[test]
    fn a_joint_without_an_angle_gets_no_point() {
        let mut feed = feed(&[(0, 9_000)]);
        feed.push(TimedPoint { time: PERIOD * 2, joints: [None; 7] });
        let taken = feed.take(PERIOD).expect("a point");
        assert_eq!((taken[0].map(FineAngle::hundredths), taken[1]), (Some(9_000), None));
    }
}
