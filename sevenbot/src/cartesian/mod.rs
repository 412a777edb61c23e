//! Converts between joint angles and positions of the tip in millimetres.
//!
//! ```text
//!   angles of the joints ──▶ TipPose: tip, tool, wrist
//!
//!   tip, tool ──▶ TipTarget: whole degrees of joints 1 to 5     or TipRefusal: reason and nearest point
//!   tip, tool, speed ──▶ StraightLine: a recording    or StraightLineError: place and reason
//!   step along axes ──▶ Jog: position and targets, from the exact position of the previous step
//!   poses, ways of the joints ──▶ Guard: above the table, out of the base
//! ```
//!
//! Origin: the base axis at the height of the top plate. x is to the right, y forward, z up. The tip is the point where
//! the axis of joint 6 meets the outer face of its disc. The tool direction points from the wrist to the tip.
//!
//! The geometry comes from [`kinematics`], the angle of a servo count from [`motion_core::calibration`]. This module does not
//! talk to the arm.

use std::fmt;

use kinematics::{Frames, forward};
use motion_core::calibration::angle_from_counts;
use protocol_core::registers::Joint;

use crate::fine_angle::FineAngle;
use crate::units::Angle;

mod guard;
mod jog;
mod line;
mod nearest;
mod refusal;
mod solve;
mod target;

pub use guard::{
    BASE_MARGIN, Breach, Guard, JointPath, KEEP_OUT_RADIUS, KEEP_OUT_TOP, PathBreach, TimedBreach,
};
pub use jog::{Jog, JogAxes, JogRefusal};
pub use kinematics::{FixedObstacle, NoSolution, Part};
pub use line::{StraightLine, StraightLineError, StraightLineFault, StraightLineRequest, TargetResolution};
pub use refusal::{GuardedTip, TipRefusal, Unreachable};
pub use target::{FineTipTarget, TipTarget};

/// A point in millimetres, or a direction.
pub type Vector = kinematics::Vector<f64>;

/// The tool straight down.
pub const DOWN: Vector = Vector::new(0.0, 0.0, -1.0);

/// The resolution in which the angles of the joints are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AngleStep {
    /// The registers of map 2.1 and 2.2: one degree.
    WholeDegree,
    /// The extended block: one count of the servo, 0.21 degrees at joints 1 to 4, and 0.29 at joints 5 and 6.
    ServoCount,
}

impl AngleStep {
    /// The steps of joints 1 to 6, in degrees.
    fn degrees(self) -> [f64; 6] {
        let [one, two, three, four, five, six, _] = Joint::ALL;
        match self {
            Self::WholeDegree => [1.0; 6],
            Self::ServoCount => [one, two, three, four, five, six].map(degrees_per_count),
        }
    }
}

/// The angle of one count of a joint's servo, in degrees.
fn degrees_per_count(joint: Joint) -> f64 {
    const COUNTS: u16 = 1_000;
    let [from, to] = [0, COUNTS].map(|counts| angle_from_counts(joint, counts, 0).0);
    f64::from(from.abs_diff(to)) / 1e6 / f64::from(COUNTS)
}

/// The positions of tip and wrist, and the direction of the tool.
///
/// ```
/// use sevenbot::Angle;
/// use sevenbot::cartesian::TipPose;
///
/// let pose = TipPose::of([90, 90, 65, 90, 90, 90, 80].map(Angle::from_register));
/// assert_eq!((pose.tip.y, pose.tip.z), (250.31, 219.5));
/// assert_eq!(pose.tool.y, 1.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipPose {
    /// The tip, in millimetres.
    pub tip: Vector,
    /// The direction of the tool, of length 1.
    pub tool: Vector,
    /// The common point of the axes of joints 4, 5 and 6, in millimetres.
    pub wrist: Vector,
}

impl TipPose {
    /// From the joint angles, joint 1 first.
    #[must_use]
    pub fn of([t1, t2, t3, t4, t5, t6, _]: [Angle; 7]) -> Self {
        Self::at([t1, t2, t3, t4, t5, t6].map(|angle| f64::from(angle.degrees())))
    }

    /// From the joint angles in hundredths of a degree, joint 1 first.
    #[must_use]
    pub fn of_fine([t1, t2, t3, t4, t5, t6, _]: [FineAngle; 7]) -> Self {
        Self::at([t1, t2, t3, t4, t5, t6].map(FineAngle::degrees))
    }

    /// From the angles of joints 1 to 6, in degrees.
    #[must_use]
    pub fn at(angles: [f64; 6]) -> Self {
        let Frames { arm, hand } = forward(angles);
        Self { tip: hand.tip, tool: hand.tool, wrist: arm.wrist }
    }

    /// An upper bound for the error, in millimetres, of a position that is computed from rounded angles: each joint may be off by
    /// half a step.
    #[must_use]
    pub fn rounding_mm([t1, t2, t3, t4, t5, t6, _]: [FineAngle; 7], step: AngleStep) -> f64 {
        let angles = [t1, t2, t3, t4, t5, t6].map(FineAngle::degrees);
        let tip = Self::at(angles).tip;
        (step.degrees().into_iter().enumerate())
            .map(|(joint, step)| {
                let mut turned = angles;
                if let Some(angle) = turned.get_mut(joint) {
                    *angle += step / 2.0;
                }
                (Self::at(turned).tip - tip).length()
            })
            .sum()
    }
}

/// The angle between two directions of length 1, in degrees.
pub(crate) fn angle_between(one: Vector, other: Vector) -> f64 {
    one.cross(other).length().atan2(one.dot(other)).to_degrees()
}

/// A point as text: `0 185 50`.
///
/// ```
/// use sevenbot::cartesian::{PointText, Vector};
///
/// assert_eq!(PointText(Vector::new(-0.04, 185.0, 49.96)).to_string(), "0 185 50");
/// assert_eq!(PointText(Vector::new(0.5, -0.5, 12.34)).to_string(), "0.5 -0.5 12.3");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PointText(pub Vector);

impl fmt::Display for PointText {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = [self.0.x, self.0.y, self.0.z].map(|number| rounded(number, 10.0));
        write!(out, "{x} {y} {z}")
    }
}

/// A direction as text: a name such as `straight down`, or `0 0.71 -0.71`.
///
/// ```
/// use sevenbot::cartesian::{DOWN, DirectionText, Vector};
///
/// assert_eq!(DirectionText(DOWN).to_string(), "straight down (0 0 -1)");
/// assert_eq!(DirectionText(Vector::new(0.0, 1.0, -1.0)).to_string(), "in the direction 0 0.71 -0.71");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DirectionText(pub Vector);

const NAMED: [(&str, [f64; 3]); 6] = [
    ("straight down", [0.0, 0.0, -1.0]),
    ("straight up", [0.0, 0.0, 1.0]),
    ("forward", [0.0, 1.0, 0.0]),
    ("backward", [0.0, -1.0, 0.0]),
    ("to the right", [1.0, 0.0, 0.0]),
    ("to the left", [-1.0, 0.0, 0.0]),
];

impl fmt::Display for DirectionText {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = self.0.unit().unwrap_or(self.0);
        let [x, y, z] = [unit.x, unit.y, unit.z].map(|number| rounded(number, 100.0));
        match NAMED.into_iter().find(|(_, named)| *named == [x, y, z]) {
            Some((words, _)) => write!(out, "{words} ({x} {y} {z})"),
            None => write!(out, "in the direction {x} {y} {z}"),
        }
    }
}

/// The nearest multiple of 1 / `steps`, without the sign of -0.
fn rounded(number: f64, steps: f64) -> f64 {
    (number * steps).round() / steps + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_the_angles_leave_millimetres_open() {
        let pose = [90, 90, 65, 90, 90, 90, 80].map(Angle::from_register).map(FineAngle::from);
        // Half a degree of joint 1 at 250 mm, joint 2 at 120 mm, joint 3 at 222 mm, and the hand.
        let (arm, hand) = (250.31 + 120.0 + 220.96_f64.hypot(25.0), 22.46);
        for (step, expected) in [
            (AngleStep::WholeDegree, 0.5_f64.to_radians() * (arm + hand)),
            (
                AngleStep::ServoCount,
                (90.0_f64 / 850.0).to_radians() * arm + (90.0_f64 / 625.0).to_radians() * hand,
            ),
        ] {
            let open = TipPose::rounding_mm(pose, step);
            assert!((open - expected).abs() < 0.05, "{open} {expected}");
        }
    }

    #[test]
    fn the_angle_between_directions_is_exact_at_its_ends() {
        let (x, y) = (Vector::new(1.0, 0.0, 0.0), Vector::new(0.0, 1.0, 0.0));
        assert_eq!([angle_between(x, x), angle_between(x, y), angle_between(x, -x)], [0.0, 90.0, 180.0]);
    }
}
