//! Plans a straight line of the tip, checks the whole line, and rounds it to targets that the arm takes.
//!
//! ```text
//!   start, end, speed ──▶ TipPath: tip and tool at any fraction of the line
//!       10 or more checks a period, at most 0.5 mm apart ──▶ angles of the same branch ──▶ reach, jumps and speeds checked
//!       each period ──▶ whole degrees, or hundredths ──▶ Moment, and its distance from the line
//! ```

use std::time::Duration;

use kinematics::{NoSolution, ik6_all};

use super::guard::{Escape, Guard};
use super::refusal::Unreachable;
use super::{TipPose, Vector};
use crate::fine_angle::FineAngle;
use crate::recording::{Moment, Recording};
use crate::units::Speed;

mod fault;
mod path;
mod rounding;

pub use fault::{StraightLineError, StraightLineFault};
use path::TipPath;
pub use rounding::TargetResolution;
use rounding::{LineAngles, PlannedPose, Rounding};

/// The largest turning speed of the tool, in degrees/s.
const TURN_SPEED: f64 = 60.0;
/// The smallest number of checks in a period.
const LEAST_CHECKS: f64 = 10.0;
/// The largest distance between two checks, in millimetres.
const CHECK_EVERY: f64 = 0.5;
/// The largest turn of a joint between two checks, in degrees. A larger turn means another branch of the solution.
const JUMP: f64 = 5.0;
/// Joint 5 at this angle points the tool along the forearm. Joint 4 then turns neither tip nor tool.
const IN_LINE: f64 = 90.0;

/// A straight line of the tip that the arm can follow.
#[derive(Clone, Debug, PartialEq)]
pub struct StraightLine {
    /// The pose at the start, from the targets of the arm at rest.
    pub start: TipPose,
    /// The length of the line, in millimetres.
    pub length_mm: f64,
    /// The duration of the line, without the turn of joint 4 before it.
    pub duration: Duration,
    /// The targets over the time of the line, as a recording to play.
    pub recording: Recording,
    /// The largest distance of the tip from the line at a target, in millimetres. Rounded angles cause it.
    pub deviation_mm: f64,
    /// The largest angle of the tool to its exact direction at a target, in degrees. Rounded angles cause it.
    pub tilt_degrees: f64,
    /// The angle to which joint 4 turns before the line starts, without moving tip or tool. `None` if it stays.
    pub first_turn: Option<FineAngle>,
}

/// The line to plan, and the state of the arm at its start.
#[derive(Clone, Copy, Debug)]
pub struct StraightLineRequest {
    /// The targets of the arm at rest, joint 1 first.
    pub start: [FineAngle; 7],
    /// The resolution of the targets on the way.
    pub resolution: TargetResolution,
    /// Does the pump suck?
    pub vacuum: bool,
    /// The end of the line, in millimetres.
    pub tip: Vector,
    /// The direction of the tool at the end, of any length. It turns evenly on the way.
    pub tool: Vector,
    /// Speed of the tip in mm/s. A large turn of the tool makes the line slower.
    pub speed: f64,
    /// The guard of the workspace; `None`: there is none.
    pub guard: Option<Guard>,
}

impl StraightLine {
    /// Plans a line. The angles of joints 6 and 7 do not change.
    ///
    /// # Errors
    /// The point where the arm cannot follow the line, and the reason.
    pub fn plan(request: &StraightLineRequest) -> Result<Self, StraightLineError> {
        let start = TipPose::of_fine(request.start);
        let end = request.tool.unit().ok_or_else(|| {
            StraightLineError::at_start(NoSolution::NoToolDirection, request.tip, request.tool)
        })?;
        if !request.tip.is_finite() {
            return Err(StraightLineError::at_start(NoSolution::NotFinite, request.tip, request.tool));
        }
        let path = TipPath::new(start, request.tip, end);
        let pace = LineTiming::of(&path, request.speed, request.resolution);
        let angles = start_angles(request, &path, &pace);
        let poses = pace.follow(&path, angles, request)?;
        let last = request.start.get(3).copied();
        let turned = poses.first().map(|pose| pose.angles[3]);
        Ok(Self {
            start,
            length_mm: path.length,
            duration: pace.duration,
            deviation_mm: poses.iter().map(|pose| pose.deviation_mm).fold(0.0, f64::max),
            tilt_degrees: poses.iter().map(|pose| pose.tilt_degrees).fold(0.0, f64::max),
            first_turn: turned.filter(|_| turned != last),
            recording: recording(request, &pace, &poses),
        })
    }

    /// The targets in the order of time, joint 1 first. The time between two is at most [`TargetResolution::period`].
    pub fn targets(&self) -> impl Iterator<Item = [FineAngle; 7]> {
        self.recording.moments().map(|moment| moment.pose)
    }
}

/// Divides the duration of a line into periods, and each period into checks.
struct LineTiming {
    duration: Duration,
    /// The number of targets after the first.
    periods: u32,
    /// Checks in a period.
    checks: u32,
}

impl LineTiming {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and is not negative"
    )]
    fn of(path: &TipPath, speed: f64, resolution: TargetResolution) -> Self {
        let period = resolution.period();
        let seconds = (path.length / speed).max(path.turn_degrees / TURN_SPEED);
        let periods = (seconds / period.as_secs_f64()).ceil().max(1.0);
        let checks = (path.length / periods / CHECK_EVERY).ceil().max(LEAST_CHECKS);
        let duration = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX).max(period);
        Self { duration, periods: periods as u32, checks: checks as u32 }
    }

    /// The fraction of the line at a check, 0 to 1.
    fn share(&self, check: u32) -> f64 {
        f64::from(check) / (f64::from(self.periods) * f64::from(self.checks))
    }

    /// Seconds between two checks.
    fn interval(&self) -> f64 {
        self.duration.as_secs_f64() * self.share(1)
    }

    /// Checks the whole path. Returns a pose for each period.
    fn follow(
        &self,
        path: &TipPath,
        start: LineAngles,
        request: &StraightLineRequest,
    ) -> Result<Vec<PlannedPose>, StraightLineError> {
        let rounding = Rounding { resolution: request.resolution, guard: request.guard };
        let mut guarded = GuardedLine::new(path, request);
        let (mut angles, mut fastest) = (start, JointTurn::default());
        let mut poses = vec![rounding.pose(start, path, 0.0)];
        guarded.check(0.0, start, poses.last())?;
        let end = self.periods.saturating_mul(self.checks);
        for check in 1..=end {
            let share = self.share(check);
            let next = solved(path, share, angles, request.guard.as_ref())?;
            let turn = JointTurn::between(angles, next, share);
            if turn.degrees > JUMP {
                let JointTurn { joint, degrees, .. } = turn;
                return Err(StraightLineError::new(
                    path,
                    share,
                    StraightLineFault::Singular { joint, degrees },
                ));
            }
            fastest = if turn.degrees > fastest.degrees { turn } else { fastest };
            angles = next;
            let pose = if check == end {
                Some(rounding.last_pose(angles, path))
            } else {
                (check % self.checks == 0).then(|| rounding.pose(angles, path, share))
            };
            guarded.check(share, angles, pose.as_ref())?;
            poses.extend(pose);
        }
        self.check_speed(path, fastest, request.speed).map(|()| poses)
    }

    /// Checks the speed of the joint that turns fastest.
    fn check_speed(&self, path: &TipPath, fastest: JointTurn, speed: f64) -> Result<(), StraightLineError> {
        // The speed register has no value between this and the maximum.
        let limit = Speed::from_steps(100).map_or(0.0, Speed::degrees_per_second);
        let degrees_per_second = fastest.degrees / self.interval();
        if degrees_per_second <= limit {
            return Ok(());
        }
        let slower_mm_per_second = (speed * limit / degrees_per_second).floor();
        let fault =
            StraightLineFault::TooFast { joint: fastest.joint, degrees_per_second, slower_mm_per_second };
        Err(StraightLineError::new(path, fastest.share, fault))
    }
}

/// Checks a line against the guard: the exact angles, and also targets in whole degrees, which are some millimetres away
/// from the line.
struct GuardedLine<'a> {
    path: &'a TipPath,
    guard: Option<Guard>,
    is_rounded: bool,
    exact: Escape,
    rounded: Escape,
}

impl<'a> GuardedLine<'a> {
    fn new(path: &'a TipPath, request: &StraightLineRequest) -> Self {
        let is_rounded = request.resolution == TargetResolution::Degrees;
        let (exact, rounded) = (Escape::default(), Escape::default());
        Self { path, guard: request.guard, is_rounded, exact, rounded }
    }

    /// Checks exact angles, and the targets for them.
    fn check(
        &mut self,
        share: f64,
        exact: LineAngles,
        targets: Option<&PlannedPose>,
    ) -> Result<(), StraightLineError> {
        let Some(guard) = self.guard else { return Ok(()) };
        let targets = targets.filter(|_| self.is_rounded).map(PlannedPose::degrees);
        let checked = self.exact.check(&guard, exact);
        let checked = checked.and_then(|()| targets.map_or(Ok(()), |it| self.rounded.check(&guard, it)));
        checked.map_err(|why| StraightLineError::new(self.path, share, StraightLineFault::Guarded(why)))
    }
}

/// The joint that turns furthest between two checks.
#[derive(Clone, Copy, Debug, Default)]
struct JointTurn {
    joint: u8,
    degrees: f64,
    /// The fraction of the line, 0 to 1.
    share: f64,
}

impl JointTurn {
    fn between(from: LineAngles, to: LineAngles, share: f64) -> Self {
        let turns = (1..).zip(from.iter().zip(to)).map(|(joint, (from, to))| (joint, (to - from).abs()));
        let (joint, degrees) = turns.fold((0, 0.0), |most, turn| if turn.1 > most.1 { turn } else { most });
        Self { joint, degrees, share }
    }
}

/// Of the solutions at this fraction of the line, the one nearest to the previous angles.
fn solved(
    path: &TipPath,
    share: f64,
    before: LineAngles,
    guard: Option<&Guard>,
) -> Result<LineAngles, StraightLineError> {
    let (tip, tool) = path.at(share);
    let all = ik6_all(tip, tool);
    let all = all.map_err(|why| {
        StraightLineError::new(
            path,
            share,
            StraightLineFault::Unreachable(Box::new(Unreachable::because(why, tip, tool, guard))),
        )
    })?;
    let furthest = |angles: &LineAngles| {
        angles.iter().zip(before).map(|(angle, before)| (angle - before).abs()).fold(0.0, f64::max)
    };
    let free = |mut angles: LineAngles| {
        // With the tool in line with the forearm, any angle of joint 4 is a solution. Joint 4 keeps its angle.
        if let ([_, _, _, t4, t5], [_, _, _, before, _]) = (&mut angles, before)
            && (*t5 - IN_LINE).abs() < 1e-6
        {
            *t4 = before;
        }
        angles
    };
    let nearest = all
        .into_iter()
        .flatten()
        .map(free)
        .reduce(|nearest, angles| if furthest(&angles) < furthest(&nearest) { angles } else { nearest });
    Ok(nearest.unwrap_or(before))
}

/// The angles at the start of the line. If the tool is in line with the forearm, joint 4 first turns to where the
/// line needs it next.
fn start_angles(request: &StraightLineRequest, path: &TipPath, pace: &LineTiming) -> LineAngles {
    let [t1, t2, t3, t4, t5, ..] = request.start.map(FineAngle::degrees);
    let angles = [t1, t2, t3, t4, t5];
    if (t5 - IN_LINE).abs() > f64::EPSILON {
        return angles;
    }
    let next = solved(path, pace.share(1), angles, request.guard.as_ref());
    next.map_or(angles, |[_, _, _, roll, _]| [t1, t2, t3, roll.round(), t5])
}

fn recording(request: &StraightLineRequest, pace: &LineTiming, poses: &[PlannedPose]) -> Recording {
    let [.., sixth, seventh] = request.start;
    let moments = (0..).zip(poses).map(|(period, pose): (u32, _)| {
        let [t1, t2, t3, t4, t5] = pose.angles;
        let time = pace.duration.mul_f64(f64::from(period) / f64::from(pace.periods));
        Moment {
            time,
            pose: [t1, t2, t3, t4, t5, sixth, seventh].map(FineAngle::from),
            vacuum: request.vacuum,
        }
    });
    Recording::from_moments(moments)
}

#[cfg(test)]
mod tests;
