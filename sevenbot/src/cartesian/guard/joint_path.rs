//! The way of the joints from one pose to another, as the controller moves them.
//!
//! Each joint turns at a constant speed (D10, D11). All start together, but may arrive at different times. The tip describes
//! a curve, which may be lower than both ends.

use crate::units::{MoveTime, Speed};

/// The largest turn of a joint between two poses, in degrees.
const STEP_DEGREES: f64 = 0.1;

/// A movement of joints 1 to 5 from one pose to another, each at a constant speed.
///
/// ```
/// use sevenbot::cartesian::JointPath;
///
/// let path = JointPath::together([90.0; 5], [95.0, 90.0, 90.0, 90.0, 90.0]);
/// assert_eq!(path.poses().last(), Some((1.0, [95.0, 90.0, 90.0, 90.0, 90.0])));
/// assert!(path.poses().count() >= 51);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPath {
    from: [f64; 5],
    to: [f64; 5],
    /// How long each joint turns, in seconds. Always 1 in [`Self::together`], where only the fraction of the way counts.
    seconds: [f64; 5],
}

impl JointPath {
    /// A way on which all joints arrive together.
    #[must_use]
    pub const fn together(from: [f64; 5], to: [f64; 5]) -> Self {
        Self { from, to, seconds: [1.0; 5] }
    }

    /// A way with these values of the speed and time registers. A time applies only at the maximum speed (D11).
    #[must_use]
    pub fn at_pace(from: [f64; 5], to: [f64; 5], speeds: [Speed; 5], times: [MoveTime; 5]) -> Self {
        let mut seconds = [0.0; 5];
        let joints = from.iter().zip(to).zip(speeds).zip(times);
        for (seconds, (((from, to), speed), time)) in seconds.iter_mut().zip(joints) {
            let at_speed = (to - from).abs() / speed.degrees_per_second();
            let timed = if speed == Speed::MAXIMUM { time.duration().as_secs_f64() } else { 0.0 };
            *seconds = at_speed.max(timed);
        }
        Self { from, to, seconds }
    }

    /// The poses from the start to the end, each with its fraction of the duration. No joint turns by more than 0.1 degrees
    /// between two poses.
    pub fn poses(&self) -> impl Iterator<Item = (f64, [f64; 5])> {
        let duration = self.seconds.iter().copied().fold(0.0, f64::max);
        let times = std::iter::successors(Some(0.0), move |&time| self.next_time(time, duration));
        times.map(move |time| {
            let share = if time < duration { time / duration } else { 1.0 };
            (share, self.at(time))
        })
    }

    /// The time at which the fastest joint that still turns has turned by one more step; `None` at the end of the way.
    fn next_time(&self, time: f64, duration: f64) -> Option<f64> {
        if time >= duration {
            return None;
        }
        let joints = self.from.iter().zip(self.to).zip(self.seconds);
        let speeds = joints.filter(|(_, seconds)| *seconds > time);
        let fastest = speeds.map(|((from, to), seconds)| (to - from).abs() / seconds).fold(0.0, f64::max);
        Some((time + STEP_DEGREES / fastest.max(f64::MIN_POSITIVE)).min(duration))
    }

    fn at(&self, time: f64) -> [f64; 5] {
        let mut angles = self.to;
        for ((angle, from), seconds) in angles.iter_mut().zip(self.from).zip(self.seconds) {
            if time < seconds {
                *angle = from + (*angle - from) * (time / seconds);
            }
        }
        angles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FROM: [f64; 5] = [90.0, 90.0, 65.0, 90.0, 90.0];

    #[test]
    fn a_joint_with_a_shorter_way_arrives_earlier() {
        let speeds = [Speed::from_steps(10).expect("a speed"); 5];
        let path = JointPath::at_pace(FROM, [109.0, 90.0, 74.5, 90.0, 90.0], speeds, [MoveTime::NONE; 5]);
        let (_, half) = path.poses().find(|(share, _)| *share >= 0.5).expect("a pose");
        assert!((half[0] - 99.5).abs() < 0.2 && (half[2] - 74.5).abs() < 0.2, "{half:?}");
        assert!((path.poses().count() - 1).abs_diff(190) <= 1);
    }

    #[test]
    fn a_duration_lets_all_arrive_together() {
        let path = JointPath::at_pace(
            FROM,
            [109.0, 90.0, 74.5, 90.0, 90.0],
            [Speed::MAXIMUM; 5],
            [MoveTime::from_steps(20).expect("a time"); 5],
        );
        let (_, half) = path.poses().find(|(share, _)| *share >= 0.5).expect("a pose");
        assert!((half[0] - 99.5).abs() < 0.2 && (half[2] - 69.75).abs() < 0.2, "{half:?}");
    }

    #[test]
    fn no_joint_turns_further_than_a_step_and_the_end_is_exact() {
        let mut speeds = [Speed::MAXIMUM; 5];
        speeds[1] = Speed::from_steps(1).expect("a speed");
        let to = [10.0, 20.0, 120.0, 80.0, 170.0];
        let poses: Vec<_> = JointPath::at_pace(FROM, to, speeds, [MoveTime::NONE; 5]).poses().collect();
        assert_eq!((poses[0], *poses.last().expect("an end")), ((0.0, FROM), (1.0, to)));
        for pair in poses.windows(2) {
            let turns = pair[0].1.iter().zip(pair[1].1).map(|(one, other)| (one - other).abs());
            assert!(turns.fold(0.0, f64::max) < STEP_DEGREES + 1e-9, "{pair:?}");
        }
        assert!(poses.len() < 3_000, "{}", poses.len());
    }

    #[test]
    fn a_way_of_no_length_is_its_pose() {
        let poses: Vec<_> =
            JointPath::at_pace(FROM, FROM, [Speed::MAXIMUM; 5], [MoveTime::NONE; 5]).poses().collect();
        assert_eq!(poses, [(1.0, FROM)]);
    }
}
