//! The frames that play a recording, and when to send each: arithmetic without an arm or a clock.
//!
//! ```text
//!   recording ──▶ segments of at most 50 ms ──▶ for each segment: a target, and the speed that brings
//!                                                the joint there in time
//! ```

use std::time::Duration;

use crate::fine_angle::FineAngle;
use crate::recording::{Moment, Recording};
use crate::units::{Angle, MoveTime, Speed};

/// The longest segment of an even movement. A speed is rounded up to a step of 1.9 degrees/s, so in a longer segment the
/// joint would arrive early.
pub(crate) const MAX_SEGMENT: Duration = Duration::from_millis(50);
/// Joints move faster than necessary by this factor, so that they catch up after a late frame.
const SPEED_RESERVE: f64 = 1.2;
/// A joint that moves by one degree and then rests spends at most this time on the degree.
const MAX_DEGREE_DURATION: Duration = Duration::from_millis(250);
/// Speed of the joint with the longest way during the approach to the first pose, without the reserve, in degrees/s.
const APPROACH_DEGREES_PER_SECOND: f64 = 30.0;
/// The shortest duration of the approach.
const MIN_APPROACH: Duration = Duration::from_millis(500);

/// One write frame of a playback.
///
/// ```
/// use sevenbot::{playback, recording::Recording};
///
/// # fn main() -> Result<(), sevenbot::recording::RecordingError> {
/// let text = "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n1 100 90 65 90 90 90 80 0\n";
/// let steps = playback::steps(&Recording::parse(text)?, 1.0);
/// assert_eq!(steps[0].registers().len(), 1 + 7 + 7 + 7);
/// assert_eq!(steps.last().map(|step| step.targets[0].degrees()), Some(100));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// When to send it, since the start.
    pub time: Duration,
    /// Does the pump suck?
    pub vacuum: bool,
    /// Speeds, joint 1 first.
    pub speeds: [Speed; 7],
    /// Targets, joint 1 first.
    pub targets: [Angle; 7],
}

impl Step {
    /// The values of all registers from the vacuum pump to the last target: one write frame.
    #[must_use]
    pub fn registers(&self) -> Vec<u8> {
        let mut bytes = vec![u8::from(self.vacuum)];
        bytes.extend(self.speeds.map(Speed::steps));
        // At the maximum speed a duration would apply (D11).
        bytes.extend([MoveTime::NONE.steps(); 7]);
        bytes.extend(self.targets.map(Angle::degrees));
        bytes
    }
}

/// The steps that play a recording `factor` times as fast, from its first pose. A step is due at the start of its segment.
/// The last step is due at the end of the last segment, and repeats the last target.
#[must_use]
pub fn steps(recording: &Recording, factor: f64) -> Vec<Step> {
    let points = segments(recording, factor);
    let waypoints = Waypoints { points: &points };
    let mut speeds = [Speed::MAXIMUM; 7];
    let pairs = points.iter().zip(points.iter().skip(1)).enumerate();
    let mut steps: Vec<Step> = pairs
        .map(|(index, (from, to))| {
            for (joint, speed) in speeds.iter_mut().enumerate() {
                *speed = waypoints.speed(index, joint).unwrap_or(*speed);
            }
            Step { time: from.time, vacuum: from.vacuum, speeds, targets: to.pose }
        })
        .collect();
    // The last step can still switch the pump.
    steps.extend(points.last().map(|end| Step {
        time: end.time,
        vacuum: end.vacuum,
        speeds,
        targets: end.pose,
    }));
    steps
}

/// One step that moves an arm slowly to a pose. The joints arrive at about the same time; those with a short way arrive earlier,
/// because each speed is rounded up to a step.
#[must_use]
pub fn approach(from: [Angle; 7], to: Moment) -> Step {
    let to = WholeMoment::from(to);
    let degrees = |joint| distance(&from, &to.pose, joint);
    let longest = (0..7).map(degrees).fold(0.0, f64::max);
    let duration = Duration::from_secs_f64(longest / APPROACH_DEGREES_PER_SECOND).max(MIN_APPROACH);
    let mut speeds = [Speed::MAXIMUM; 7];
    for (joint, speed) in speeds.iter_mut().enumerate() {
        *speed = speed_for(degrees(joint), duration);
    }
    Step { time: Duration::ZERO, vacuum: to.vacuum, speeds, targets: to.pose }
}

#[derive(Clone, Copy, Debug)]
struct WholeMoment {
    time: Duration,
    pose: [Angle; 7],
    vacuum: bool,
}

impl From<Moment> for WholeMoment {
    fn from(Moment { time, pose, vacuum }: Moment) -> Self {
        Self { time, pose: pose.map(FineAngle::nearest), vacuum }
    }
}

/// The moments with interpolated ones between them. Times start at 0 and are scaled by the factor.
fn segments(recording: &Recording, factor: f64) -> Vec<WholeMoment> {
    let mut points: Vec<WholeMoment> = Vec::new();
    let mut start = None;
    for moment in recording.moments() {
        let time = (moment.time - *start.get_or_insert(moment.time)).div_f64(factor);
        let to = WholeMoment { time, ..moment.into() };
        if let Some(&from) = points.last() {
            points.extend(interpolated(from, to));
        }
        points.push(to);
    }
    points
}

/// Evenly spaced moments between two moments, at most [`MAX_SEGMENT`] apart; none if the two poses are equal.
fn interpolated(from: WholeMoment, to: WholeMoment) -> impl Iterator<Item = WholeMoment> {
    let span = to.time - from.time;
    let count = span.as_millis().div_ceil(MAX_SEGMENT.as_millis());
    let count = if from.pose == to.pose { 1 } else { u32::try_from(count).unwrap_or(u32::MAX) };
    (1..count).map(move |index| {
        let share = f64::from(index) / f64::from(count);
        let mut pose = from.pose;
        for (angle, end) in pose.iter_mut().zip(to.pose) {
            *angle = interpolate(*angle, end, share);
        }
        WholeMoment { time: from.time + span.mul_f64(share), pose, vacuum: from.vacuum }
    })
}

/// The angle at `share` (0 to 1) between two angles.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two angles")]
fn interpolate(from: Angle, to: Angle, share: f64) -> Angle {
    let (from, to) = (f64::from(from.degrees()), f64::from(to.degrees()));
    Angle::from_register((from + (to - from) * share).round() as u8)
}

/// The slowest speed that covers the degrees in this time with [`SPEED_RESERVE`]; the maximum if no lower one does.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the register's range"
)]
fn speed_for(degrees: f64, duration: Duration) -> Speed {
    let step = Speed::from_steps(1).map_or(1.0, Speed::degrees_per_second);
    let steps = (SPEED_RESERVE * degrees / duration.as_secs_f64() / step).ceil().clamp(1.0, 255.0);
    Speed::from_steps(steps as u8).unwrap_or(Speed::MAXIMUM)
}

fn distance(from: &[Angle; 7], to: &[Angle; 7], joint: usize) -> f64 {
    let degrees = |pose: &[Angle; 7]| pose.get(joint).map_or(0, |angle| angle.degrees());
    f64::from(degrees(from).abs_diff(degrees(to)))
}

/// Points that the joints pass, in order of time.
struct Waypoints<'a> {
    points: &'a [WholeMoment],
}

impl Waypoints<'_> {
    /// Degrees between a point and the next one.
    fn degrees(&self, index: usize, joint: usize) -> f64 {
        let pair = self.points.get(index).zip(self.points.get(index + 1));
        pair.map_or(0.0, |(from, to)| distance(&from.pose, &to.pose, joint))
    }

    fn time(&self, index: usize) -> Duration {
        self.points.get(index).or(self.points.last()).map_or(Duration::ZERO, |point| point.time)
    }

    /// Speed of a joint from a point to the next one. `None` if it rests: the speed of its last degree then remains.
    fn speed(&self, index: usize, joint: usize) -> Option<Speed> {
        let degrees = self.degrees(index, joint);
        let until = match degrees {
            0.0 => return None,
            // A slow movement has single degrees with rests between them. Each degree fills the time to the next one, up to
            // 250 ms.
            1.0 => self.next_move(index, joint).min(self.time(index) + MAX_DEGREE_DURATION),
            _ => self.time(index + 1),
        };
        Some(speed_for(degrees, until.saturating_sub(self.time(index))))
    }

    /// When a joint that moves from this point to the next one moves again; the time of the last point if it does not.
    fn next_move(&self, index: usize, joint: usize) -> Duration {
        let mut later = index + 1..self.points.len();
        let next = later.find(|&later| self.degrees(later, joint) > 0.0);
        self.time(next.unwrap_or(usize::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(moments: &[(&str, u8)]) -> Recording {
        let line = |(time, base): &(&str, u8)| format!("{time} {base} 90 65 90 90 90 80 0\n");
        let lines: String = moments.iter().map(line).collect();
        Recording::parse(&format!("7bot-recording 1\n{lines}")).expect("a recording")
    }

    fn base_speeds(moments: &[(&str, u8)], factor: f64) -> Vec<f64> {
        let steps = steps(&recording(moments), factor);
        steps.iter().map(|step| step.speeds[0].degrees_per_second()).collect()
    }

    #[test]
    fn a_long_movement_is_cut_into_segments() {
        let steps = steps(&recording(&[("5", 90), ("6", 110)]), 1.0);
        assert_eq!(steps.len(), 21, "20 pieces and the end");
        assert_eq!(steps[0].time, Duration::ZERO, "however late the recording begins");
        assert_eq!(steps[10].time, Duration::from_millis(500));
        assert_eq!(steps[9].targets[0].degrees(), 100, "to be reached at 500 ms");
        // 1 degree in 50 ms is 20 °/s. With the reserve it is 24, and the next step up is 24.7.
        assert!((steps[0].speeds[0].degrees_per_second() - 24.7).abs() < 1e-9);
        assert_eq!(steps[20].targets[0].degrees(), 110);
    }

    #[test]
    fn the_factor_scales_times_and_speeds() {
        let moments = [("0", 90), ("0.05", 95)];
        assert!((base_speeds(&moments, 1.0)[0] - 1.9 * 64.0).abs() < 1e-9, "100 °/s, and haste");
        let slow = steps(&recording(&moments), 0.5);
        assert_eq!(slow.last().map(|step| step.time), Some(Duration::from_millis(100)));
        assert!((base_speeds(&moments, 2.0)[0] - 372.0).abs() < 1e-9, "200 °/s is above 190: the maximum");
    }

    #[test]
    fn a_slow_movement_has_an_even_speed() {
        // A degree in 200 ms, recorded every 50 ms.
        let moments = [("0", 90), ("0.05", 91), ("0.1", 91), ("0.15", 91), ("0.2", 91), ("0.25", 92)];
        let speeds = base_speeds(&moments, 1.0);
        assert!(speeds[..4].iter().all(|speed| (speed - 7.6).abs() < 1e-9), "5 °/s, and haste: {speeds:?}");
    }

    #[test]
    fn all_joints_approach_slowly_and_arrive_together() {
        let from = [90, 90, 65, 90, 90, 90, 80].map(Angle::from_register);
        let to = recording(&[("0", 150)]).moments().next().expect("one");
        let step = approach(from, to);
        assert!((step.speeds[0].degrees_per_second() - 36.1).abs() < 1e-9, "60 degrees in 2 s, and haste");
        assert_eq!(step.speeds[1].steps(), 1, "nothing to do");
        assert_eq!(step.targets, to.pose.map(FineAngle::nearest));
    }

    #[test]
    fn one_frame_holds_pump_speeds_times_and_targets() {
        let steps = steps(&recording(&[("0", 90), ("0.05", 95)]), 1.0);
        let bytes = steps[0].registers();
        assert_eq!(bytes.len(), 22);
        assert_eq!((bytes[0], bytes[1], bytes[8], bytes[15]), (0, 64, 0, 95));
    }
}
