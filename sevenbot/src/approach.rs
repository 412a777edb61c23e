//! The way to the first point of a stream or a recording. A long way is refused, unless the caller asks for it.
//!
//! ```text
//!   Standing: where the arm is ──┐
//!   first point ─────────────────┼──▶ Approach: a smooth way there ──▶ points at any time
//!   ApproachRule ────────────────┘    or StartTooFar: the joints that are too far away
//! ```
//!
//! Arithmetic only, without an arm or a clock. The command line, Python and the page share it.

use std::fmt;
use std::time::Duration;

use protocol_core::registers::Joint;
use protocol_core::registers::map::{FINE_POSITION, FINE_TARGET, PRESENT_POSITION, SPEED, TARGET_POSITION};

use crate::fine_angle::FineAngle;
use crate::fine_state::FineTargets;
use crate::recording::{Moment, Recording};
use crate::units::Speed;
use host_link::Snapshot;

/// With [`ApproachRule::Near`], a first point is refused if a joint is further from it than this, in degrees.
pub const NEAR_DEGREES: f64 = 5.0;
/// The largest speed of a joint with [`ApproachRule::Near`] and [`ApproachRule::Slowly`], in degrees/s.
const SLOW_DEGREES_PER_SECOND: f64 = 30.0;
/// The peak speed of the blend in [`Approach::at`], divided by its mean speed.
const PEAK: f64 = 1.5;
/// Time between two moments of [`Approach::recording`]. It equals `playback::MAX_SEGMENT`.
const MOMENT: Duration = Duration::from_millis(50);

/// What to do if the first point is not where the arm stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ApproachRule {
    /// Refuse a point that is further than 5 degrees for any joint. Approach a nearer one at up to 30 degrees/s.
    #[default]
    Near,
    /// Go there from anywhere in this time, or longer if a joint would exceed its speed.
    Within(Duration),
    /// Go there from anywhere at up to 30 degrees/s, for a movement that was planned from where the arm is.
    Slowly,
}

/// Where an arm stands, joint 1 first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// The measured angles in degrees; `None` for a joint that was not measured. Without the extended block, such a joint has 0.
    pub measured: [Option<f64>; 7],
    /// The targets in degrees.
    pub targets: [f64; 7],
    /// The speeds of the joints, which the approach does not exceed.
    pub speeds: [Speed; 7],
}

impl Standing {
    /// From registers 0 to 255, with 0 in the registers of each block that the firmware lacks.
    #[must_use]
    pub fn of(registers: &Snapshot) -> Self {
        let speeds = registers.joints(&SPEED).map(|steps| Speed::from_steps(steps).unwrap_or(Speed::MAXIMUM));
        if !registers.has_extended_block() {
            let [measured, targets] =
                [&PRESENT_POSITION, &TARGET_POSITION].map(|row| registers.joints(row).map(f64::from));
            return Self { measured: measured.map(Some), targets, speeds };
        }
        let angles = |row| registers.words(row).map(|word| Some(FineAngle::from_hundredths(word)?.degrees()));
        let targets = angles(&FINE_TARGET).map(Option::unwrap_or_default);
        Self { measured: angles(&FINE_POSITION), targets, speeds }
    }

    /// An arm that stands at this pose, as after a recording was played to its last moment.
    pub(crate) fn at_pose(pose: [FineAngle; 7], speeds: [Speed; 7]) -> Self {
        let targets = pose.map(FineAngle::degrees);
        Self { measured: targets.map(Some), targets, speeds }
    }
}

/// A first point that is too far away.
#[derive(Clone, Debug, PartialEq)]
pub struct StartTooFar {
    /// Each joint that is further than 5 degrees from the point, its angle, and the angle of the point, in degrees.
    pub joints: Vec<(Joint, f64, f64)>,
    /// `true`: the distances are from the end of a recording to its start. `false`: they are from where the arm stands.
    pub is_seam: bool,
}

impl fmt::Display for StartTooFar {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (begins, is) = match self.is_seam {
            false => ("the first point is far from where the arm stands", "is at"),
            true => ("the movement begins far from where it ends, so it cannot be repeated", "ends at"),
        };
        write!(out, "{begins}: ")?;
        for (index, (joint, here, first)) in self.joints.iter().enumerate() {
            let comma = if index == 0 { "" } else { ", " };
            let (number, away) = (joint.number(), (here - first).abs());
            write!(out, "{comma}joint {number} {is} {here:.2}°, {away:.2}° from {first:.2}°")?;
        }
        write!(out, "; up to {NEAR_DEGREES}° are allowed")
    }
}

impl std::error::Error for StartTooFar {}

/// A smooth way to a first point. All joints start and arrive together, at rest.
///
/// ```
/// use sevenbot::approach::{Approach, ApproachRule, Standing};
/// use sevenbot::{Angle, FineAngle, Speed};
/// use std::time::Duration;
///
/// let here = Standing { measured: [Some(90.0); 7], targets: [90.0; 7], speeds: [Speed::MAXIMUM; 7] };
/// let first = [Some(FineAngle::from(Angle::from_register(120))); 7];
/// assert!(Approach::plan(&here, &first, ApproachRule::Near).is_err());
/// let way = Approach::plan(&here, &first, ApproachRule::Within(Duration::from_secs(2)))?;
/// let middle = way.at(Duration::from_secs(1))[0].map(FineAngle::degrees);
/// assert_eq!((way.duration(), middle), (Duration::from_secs(2), Some(105.0)));
/// # Ok::<(), sevenbot::approach::StartTooFar>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    from: [f64; 7],
    to: FineTargets,
    duration: Duration,
}

impl Approach {
    /// Plans the way to a point. Joints without an angle stay.
    ///
    /// # Errors
    /// The point is too far away for the rule.
    pub fn plan(standing: &Standing, first: &FineTargets, rule: ApproachRule) -> Result<Self, StartTooFar> {
        if rule == ApproachRule::Near {
            check_near(standing, first)?;
        }
        let from = starts(standing);
        let seconds = match rule {
            ApproachRule::Within(time) => {
                shortest(&from, first, |joint| limit(standing, joint)).max(time.as_secs_f64())
            }
            ApproachRule::Near | ApproachRule::Slowly => {
                shortest(&from, first, |joint| limit(standing, joint).min(SLOW_DEGREES_PER_SECOND))
            }
        };
        let duration = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        Ok(Self { from, to: *first, duration })
    }

    /// The duration of the way. If the arm is at the point, it is 0, or the time of [`ApproachRule::Within`].
    #[must_use]
    pub const fn duration(&self) -> Duration {
        self.duration
    }

    /// The point at a time since the start.
    #[must_use]
    pub fn at(&self, time: Duration) -> FineTargets {
        if time >= self.duration {
            return self.to;
        }
        let share = time.as_secs_f64() / self.duration.as_secs_f64();
        // Goes from 0 to 1, with velocity 0 at both ends.
        let blend = share * share * (3.0 - 2.0 * share);
        let mut point = self.to;
        for (angle, from) in point.iter_mut().zip(self.from) {
            *angle = angle.and_then(|to| FineAngle::from_degrees(from + (to.degrees() - from) * blend));
        }
        point
    }

    /// The way as a recording that ends at `end`, for an arm that takes no stream. A joint without a first point has the angle
    /// of `end` all the way.
    #[must_use]
    pub fn recording(&self, end: Moment) -> Recording {
        let count = u32::try_from(self.duration.as_millis().div_ceil(MOMENT.as_millis())).unwrap_or(u32::MAX);
        let moments = (0..count).map(|number| {
            let time = MOMENT.saturating_mul(number);
            let mut pose = end.pose;
            for (angle, point) in pose.iter_mut().zip(self.at(time)) {
                *angle = point.unwrap_or(*angle);
            }
            Moment { time, pose, vacuum: end.vacuum }
        });
        let last = Moment { time: MOMENT.saturating_mul(count), ..end };
        Recording::from_moments(moments.chain(std::iter::once(last)))
    }
}

/// The joints of a stream that have had a point. Joints may get their first points at different times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FirstPoints {
    has_point: [bool; 7],
}

impl FirstPoints {
    /// Records the joints of a point. Returns the angles of the joints whose first point this is; `None` if there are none.
    pub fn take(&mut self, point: &FineTargets) -> Option<FineTargets> {
        let mut first = *point;
        for (angle, has_point) in first.iter_mut().zip(&mut self.has_point) {
            let is_known = std::mem::replace(has_point, *has_point || angle.is_some());
            *angle = angle.filter(|_| !is_known);
        }
        first.iter().any(Option::is_some).then_some(first)
    }
}

fn check_near(standing: &Standing, first: &FineTargets) -> Result<(), StartTooFar> {
    let joints = Joint::ALL.into_iter().zip(standing.measured).zip(first);
    let measured = joints.filter_map(|((joint, here), first)| Some((joint, here?, (*first)?.degrees())));
    let far: Vec<_> = measured.filter(|(_, here, first)| (here - first).abs() > NEAR_DEGREES).collect();
    if far.is_empty() { Ok(()) } else { Err(StartTooFar { joints: far, is_seam: false }) }
}

/// Where the way begins. A joint that is measured further than 5 degrees from its target begins where it is measured. Any
/// other joint begins at its target, so that its set-point makes no step although a loaded servo droops.
fn starts(standing: &Standing) -> [f64; 7] {
    let mut from = standing.targets;
    for (target, measured) in from.iter_mut().zip(standing.measured) {
        *target = measured.filter(|here| (here - *target).abs() > NEAR_DEGREES).unwrap_or(*target);
    }
    from
}

/// The speed that a joint does not exceed, in degrees/s.
fn limit(standing: &Standing, joint: usize) -> f64 {
    standing.speeds.get(joint).copied().unwrap_or(Speed::MAXIMUM).degrees_per_second()
}

/// The shortest time in seconds in which no joint exceeds its speed.
fn shortest(from: &[f64; 7], to: &FineTargets, speed: impl Fn(usize) -> f64) -> f64 {
    let ways = from.iter().zip(to).enumerate();
    let seconds = ways.filter_map(|(joint, (from, to))| {
        let degrees = ((*to)?.degrees() - from).abs();
        Some(PEAK * degrees / speed(joint))
    });
    seconds.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(degrees: [f64; 7]) -> FineTargets {
        degrees.map(FineAngle::from_degrees)
    }

    const HERE: [f64; 7] = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0];

    fn standing() -> Standing {
        Standing { measured: HERE.map(Some), targets: HERE, speeds: [Speed::MAXIMUM; 7] }
    }

    #[test]
    fn a_point_further_than_five_degrees_is_refused_with_every_distance() {
        let near = angles([95.0, 90.0, 60.0, 90.0, 90.0, 90.0, 80.0]);
        assert!(Approach::plan(&standing(), &near, ApproachRule::Near).is_ok());
        let far = angles([95.01, 90.0, 65.0, 90.0, 90.0, 90.0, 20.0]);
        let refused = Approach::plan(&standing(), &far, ApproachRule::Near).expect_err("too far");
        assert_eq!(
            refused.to_string(),
            "the first point is far from where the arm stands: joint 1 is at 90.00°, 5.01° from 95.01°, joint 7 is at \
             80.00°, 60.00° from 20.00°; up to 5° are allowed"
        );
        let mut only_first = far;
        only_first[6] = None;
        only_first[0] = None;
        assert!(Approach::plan(&standing(), &only_first, ApproachRule::Near).is_ok(), "the others stay");
    }

    #[test]
    fn no_joint_exceeds_its_speed_or_makes_a_step() {
        let first = angles([150.0, 80.0, 65.0, 90.0, 90.0, 90.0, 30.0]);
        for (steps, seconds) in [(0, 0.1), (0, 3.0), (10, 1.0), (60, 2.0)] {
            let mut here = standing();
            here.speeds = [Speed::from_steps(steps).expect("a speed"); 7];
            let rule = ApproachRule::Within(Duration::from_secs_f64(seconds));
            let way = Approach::plan(&here, &first, rule).expect("allowed");
            assert!(way.duration().as_secs_f64() >= seconds);
            let limit = here.speeds[0].degrees_per_second();
            let step = Duration::from_millis(5);
            let count = u32::try_from(way.duration().as_millis() / 5 + 2).expect("a count");
            let mut before = HERE;
            for number in 0..=count {
                let point = way.at(step * number).map(|angle| angle.expect("all have one").degrees());
                for (now, before) in point.iter().zip(before) {
                    // Rounding to 0.01 degrees in a step of 5 ms adds up to 2 degrees/s.
                    let speed = (now - before).abs() / step.as_secs_f64();
                    assert!(speed <= limit + 2.01, "{steps} {seconds}: {speed}");
                }
                before = point;
            }
            assert_eq!(way.at(way.duration()), first);
        }
    }

    #[test]
    fn a_near_point_is_approached_slowly_whatever_the_register_says() {
        let first = angles([94.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]);
        let way = Approach::plan(&standing(), &first, ApproachRule::Near).expect("near");
        assert!((way.duration().as_secs_f64() - 0.2).abs() < 1e-9, "4 degrees at up to 30 degrees/s");
        let same = Approach::plan(&standing(), &angles(HERE), ApproachRule::Near).expect("near");
        assert_eq!(same.duration(), Duration::ZERO);
    }

    #[test]
    fn a_drooping_joint_starts_at_its_target_and_a_moving_one_where_it_is() {
        let mut here = standing();
        here.measured[1] = Some(88.8);
        here.measured[0] = Some(60.0);
        let way = Approach::plan(&here, &angles(HERE), ApproachRule::Slowly).expect("allowed");
        let start = way.at(Duration::ZERO).map(|angle| angle.map(FineAngle::degrees));
        assert_eq!(start[..2], [Some(60.0), Some(90.0)]);
    }

    #[test]
    fn a_recording_of_the_way_ends_at_the_first_pose() {
        let first = angles([120.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]);
        let rule = ApproachRule::Within(Duration::from_secs(1));
        let way = Approach::plan(&standing(), &first, rule).expect("allowed");
        let pose = first.map(|angle| angle.expect("all have one"));
        let recording = way.recording(Moment { time: Duration::ZERO, pose, vacuum: true });
        let moments: Vec<_> = recording.moments().collect();
        assert_eq!((moments.len(), moments[0].pose[0].degrees()), (21, 90.0));
        assert_eq!((moments[20].time, moments[20].pose), (Duration::from_secs(1), pose));
    }

    #[test]
    fn the_first_point_of_each_joint_is_found() {
        let mut first = FirstPoints::default();
        let some = |joints: &[usize]| {
            let mut point = [None; 7];
            joints.iter().for_each(|&joint| point[joint] = FineAngle::from_degrees(90.0));
            point
        };
        assert_eq!(first.take(&some(&[0, 2])), Some(some(&[0, 2])));
        assert_eq!(first.take(&some(&[0, 2])), None);
        assert_eq!(first.take(&some(&[0, 6])), Some(some(&[6])));
        assert_eq!(first.take(&[None; 7]), None);
    }
}
