//! Computes targets in whole degrees for a position of the tip.

use std::fmt;

use kinematics::limits::check_arm;
use kinematics::{NoSolution, ik6};

use super::nearest::nearest;
use super::{DirectionText, PointText, TipPose, Vector, angle_between};
use crate::fine_angle::FineAngle;
use crate::units::Angle;

/// Radius in millimetres that converts a tilt of the tool to a distance: the edge of the disc.
const TILT_RADIUS: f64 = kinematics::geometry::DISC_RADIUS;

/// Targets of joints 1 to 5 that bring the tip to a position.
///
/// ```
/// use sevenbot::cartesian::{DOWN, TipTarget, Vector};
///
/// let target = TipTarget::of(Vector::new(-50.0, 185.0, 50.0), DOWN)?;
/// assert!((target.angles[0] - 105.124).abs() < 0.001);
/// assert!(target.miss_mm < 1.5, "whole degrees");
/// # Ok::<(), sevenbot::cartesian::Unreachable>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipTarget {
    /// The exact angles of joints 1 to 5, in degrees.
    pub angles: [f64; 5],
    /// Angles in whole degrees that the registers can hold and the arm can take.
    pub degrees: [u8; 5],
    /// The pose of the tip at these degrees.
    pub reached: TipPose,
    /// The distance to the requested position, in millimetres.
    pub miss_mm: f64,
    /// The angle to the requested direction of the tool, in degrees.
    pub tilt_degrees: f64,
}

/// Targets of joints 1 to 5 in hundredths of a degree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FineTipTarget {
    /// The angles of joints 1 to 5.
    pub angles: [FineAngle; 5],
    /// The pose of the tip at these angles.
    pub reached: TipPose,
    /// The distance to the requested position, in millimetres.
    pub miss_mm: f64,
    /// The angle to the requested direction of the tool, in degrees.
    pub tilt_degrees: f64,
}

impl TipTarget {
    /// The targets for a tip in millimetres, with the tool in a direction of any length.
    ///
    /// # Errors
    /// The position is out of reach: the reason, and the nearest point within reach.
    pub fn of(tip: Vector, tool: Vector) -> Result<Self, Unreachable> {
        let angles = ik6(tip, tool).map_err(|why| Unreachable::because(why, tip, tool))?;
        Ok(Self::near(angles, tip, tool.unit().unwrap_or(tool)))
    }

    /// The whole degrees beside exact angles that the arm can take, with the smallest miss.
    pub(super) fn near(angles: [f64; 5], tip: Vector, tool: Vector) -> Self {
        let candidates = (0..32).map(|choice| Self::with(angles, beside(angles, choice), tip, tool));
        let legal = candidates.filter(|target| check_arm(target.pose()).is_ok());
        // The limits are whole degrees, so one of the candidates is within them.
        let best = legal.reduce(|best, next| if next.cost() < best.cost() { next } else { best });
        best.unwrap_or_else(|| Self::with(angles, angles.map(f64::round), tip, tool))
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 180 degrees")]
    fn with(angles: [f64; 5], whole: [f64; 5], tip: Vector, tool: Vector) -> Self {
        let [t1, t2, t3, t4, t5] = whole;
        // Joint 6 moves neither tip nor tool.
        let reached = TipPose::at([t1, t2, t3, t4, t5, 90.0]);
        Self {
            angles,
            degrees: whole.map(|degrees| degrees as u8),
            reached,
            miss_mm: (reached.tip - tip).length(),
            tilt_degrees: angle_between(reached.tool, tool),
        }
    }

    /// The targets in hundredths of a degree, with the tip and the misses there. `None` if rounding breaks a limit of the
    /// arm: then only the whole degrees are legal.
    #[must_use]
    pub fn in_hundredths(&self, tip: Vector, tool: Vector) -> Option<FineTipTarget> {
        let mut angles = [FineAngle::from(Angle::from_register(0)); 5];
        for (angle, degrees) in angles.iter_mut().zip(self.angles) {
            *angle = FineAngle::from_degrees(degrees)?;
        }
        let [t1, t2, t3, t4, t5] = angles.map(FineAngle::degrees);
        let pose = [t1, t2, t3, t4, t5, 90.0];
        check_arm(pose).ok()?;
        let reached = TipPose::at(pose);
        let tilt_degrees = angle_between(reached.tool, tool.unit().unwrap_or(tool));
        Some(FineTipTarget { angles, reached, miss_mm: (reached.tip - tip).length(), tilt_degrees })
    }

    fn pose(&self) -> [f64; 6] {
        let [t1, t2, t3, t4, t5] = self.degrees.map(f64::from);
        [t1, t2, t3, t4, t5, 90.0]
    }

    fn cost(&self) -> f64 {
        self.miss_mm.hypot(self.tilt_degrees.to_radians() * TILT_RADIUS)
    }
}

/// Each angle rounded down or up, as the bits of `choice` say.
fn beside(angles: [f64; 5], choice: u8) -> [f64; 5] {
    let mut whole = angles;
    for (joint, angle) in whole.iter_mut().enumerate() {
        let down = angle.floor();
        *angle = if choice >> joint & 1 == 0 { down } else { angle.ceil() };
    }
    whole
}

/// Why the arm does not reach a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unreachable {
    /// The reason.
    pub why: NoSolution,
    /// The requested tip, in millimetres.
    pub tip: Vector,
    /// The requested direction of the tool.
    pub tool: Vector,
    /// The nearest point that the tip reaches with this direction of the tool, to a tenth of a millimetre. `None` if
    /// there is none within reach or the numbers are no position.
    pub nearest: Option<Vector>,
    /// A usual direction of the tool with which the tip reaches the requested point; `None` if there is none.
    pub other_tool: Option<Vector>,
}

impl Unreachable {
    pub(super) fn because(why: NoSolution, tip: Vector, tool: Vector) -> Self {
        Self { why, tip, tool, nearest: nearest(tip, tool), other_tool: other_tool(tip) }
    }

    /// The distance from the requested point to the nearest point within reach, in millimetres.
    #[must_use]
    pub fn distance_mm(&self) -> Option<f64> {
        self.nearest.map(|nearest| (nearest - self.tip).length())
    }
}

/// The first of the usual directions with which the tip reaches a point: down, outward, between them, up.
fn other_tool(tip: Vector) -> Option<Vector> {
    let outward = Vector::new(tip.x, tip.y, 0.0).unit().unwrap_or(Vector::new(0.0, 1.0, 0.0));
    let [x, y] = [outward.x, outward.y].map(|component| (component * 100.0).round() / 100.0);
    let usual = [(0.0, -1.0), (1.0, -1.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let directions = usual.map(|(outward, up)| Vector::new(x * outward, y * outward, up));
    directions.into_iter().find(|&tool| ik6(tip, tool).is_ok())
}

impl fmt::Display for Unreachable {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.why {
            NoSolution::NoToolDirection => return out.write_str("the tool direction 0 0 0 points nowhere"),
            NoSolution::NotFinite => return out.write_str("a position is three finite numbers"),
            _ => {}
        }
        let (tip, tool) = (PointText(self.tip), DirectionText(self.tool));
        write!(out, "{tip} mm with the tool {tool} is out of reach: {}", self.reason())?;
        match (self.nearest, self.distance_mm()) {
            (Some(nearest), Some(mm)) => {
                write!(out, "; the nearest point within reach is {} mm, {mm:.1} mm away", PointText(nearest))
            }
            _ => out.write_str("; no point is within reach with this tool direction"),
        }
    }
}

impl Unreachable {
    /// The reason as text, with the parts that a user sees.
    #[must_use]
    pub const fn reason(&self) -> &'static str {
        match self.why {
            NoSolution::TooFar => "it is too far from the shoulder",
            NoSolution::TooNear => "it is too near to the shoulder",
            NoSolution::Joint(1) => "it is behind the arm, and the base (joint 1) turns by 180° only",
            NoSolution::Joint(2) => "the rear arm (joint 2) does not lean so far",
            NoSolution::Joint(_) => "the forearm (joint 3) does not tilt so far",
            NoSolution::ToolDirection => "the hand (joint 5) does not bend so far back",
            NoSolution::NoHeading => "the wrist would be on the axis of the base, where joint 1 has no angle",
            NoSolution::NoToolDirection | NoSolution::NoDiscDirection | NoSolution::NotFinite => {
                "no position"
            }
        }
    }
}

impl std::error::Error for Unreachable {}

#[cfg(test)]
mod tests {
    use super::super::DOWN;
    use super::*;
    use kinematics::forward;

    fn v(x: f64, y: f64, z: f64) -> Vector {
        Vector::new(x, y, z)
    }

    #[test]
    fn the_makers_example_is_reached_to_a_millimetre() {
        let target = TipTarget::of(v(-50.0, 185.0, 50.0), DOWN).expect("within reach");
        let exact = [105.124, 88.229, 109.746, 90.0, 135.254];
        assert!(target.angles.iter().zip(exact).all(|(angle, exact)| (angle - exact).abs() < 0.001));
        assert_eq!(target.degrees, [105, 88, 110, 90, 135]);
        assert!(target.miss_mm < 1.0 && target.tilt_degrees < 1.0, "{target:?}");
        let fine = target.in_hundredths(v(-50.0, 185.0, 50.0), DOWN).expect("within the limits");
        assert_eq!(fine.angles[0].hundredths(), 10_512);
        assert!(fine.miss_mm < 0.05 && fine.tilt_degrees < 0.02, "{fine:?}");
    }

    #[test]
    fn whole_degrees_keep_the_limits_and_miss_by_little() {
        let mut worst: f64 = 0.0;
        for (t2, t3) in (0..=180_u8).flat_map(|t2| (0..=180_u8).map(move |t3| (t2, t3))) {
            for part in [0.0, 0.5] {
                let pose = [77.3, f64::from(t2), f64::from(t3) + part, 80.0, 100.4, 90.0];
                if check_arm(pose).is_err() {
                    continue;
                }
                let hand = forward(pose).hand;
                let target = TipTarget::of(hand.tip, hand.tool).expect("a legal pose");
                assert_eq!(check_arm(target.pose()), Ok(()), "{pose:?}");
                worst = worst.max(target.miss_mm);
            }
        }
        assert!(worst < 3.0, "{worst} mm");
    }

    #[test]
    fn what_is_out_of_reach_says_how_far_and_what_is_within() {
        let refused = TipTarget::of(v(0.0, 500.0, 50.0), DOWN).expect_err("too far");
        let words = refused.to_string();
        assert!(
            words.starts_with(
                "0 500 50 mm with the tool straight down (0 0 -1) is out of reach: it is too far"
            )
        );
        let nearest = refused.nearest.expect("one");
        assert!(words.ends_with(&format!(
            "the nearest point within reach is {} mm, {:.1} mm away",
            PointText(nearest),
            (nearest - refused.tip).length()
        )));
        assert!(TipTarget::of(nearest, DOWN).is_ok(), "the point that is told can be asked for");
    }

    #[test]
    fn a_direction_that_works_is_found_where_the_one_asked_for_does_not() {
        let refused = TipTarget::of(v(0.0, 250.0, 280.0), DOWN).expect_err("too high for that");
        let other = refused.other_tool.expect("forward or so");
        assert!(TipTarget::of(refused.tip, other).is_ok());
        let refused = TipTarget::of(v(0.0, 900.0, 0.0), DOWN).expect_err("too far for all");
        assert_eq!(refused.other_tool, None);
    }

    #[test]
    fn numbers_that_are_no_position_are_told() {
        let words = |tip, tool| TipTarget::of(tip, tool).expect_err("none").to_string();
        assert!(words(v(0.0, 200.0, 50.0), v(0.0, 0.0, 0.0)).contains("points nowhere"));
        assert!(words(v(f64::NAN, 200.0, 50.0), DOWN).contains("finite"));
    }
}
