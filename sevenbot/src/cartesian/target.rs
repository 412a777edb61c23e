//! Rounds the exact angles for a position of the tip to targets in whole degrees or in hundredths.

use kinematics::limits::check_arm;

use super::guard::Guard;
use super::{TipPose, Vector, angle_between};
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
    /// Rounds each exact angle down or up, so that the whole degrees are within the limits of the arm and the miss is the
    /// smallest. Prefers degrees that the guard allows.
    pub(super) fn near(angles: [f64; 5], tip: Vector, tool: Vector, guard: Option<&Guard>) -> Self {
        let candidates = || (0..32).map(|choice| Self::with(angles, beside(angles, choice), tip, tool));
        let legal = || candidates().filter(|target| check_arm(target.pose()).is_ok());
        let allowed = legal().filter(|target| guard.is_none_or(|guard| target.is_allowed_by(guard)));
        let better = |best: Self, next: Self| if next.cost() < best.cost() { next } else { best };
        // The limits are whole degrees, so one of the candidates is within them.
        let best = allowed.reduce(better).or_else(|| legal().reduce(better));
        best.unwrap_or_else(|| Self::with(angles, angles.map(f64::round), tip, tool))
    }

    /// Does the guard allow the whole degrees?
    pub(super) fn is_allowed_by(&self, guard: &Guard) -> bool {
        guard.check_pose(self.degrees.map(f64::from)).is_ok()
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
