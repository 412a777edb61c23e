//! Rounds the exact angles of a line to targets that the arm takes, and measures the deviation that this causes.

use std::time::Duration;

use kinematics::limits::check_arm;

use super::super::guard::Guard;
use super::super::target::TipTarget;
use super::super::{TipPose, angle_between};
use super::path::TipPath;
use crate::fine_angle::FineAngle;
use crate::playback::MAX_SEGMENT;
use crate::units::Angle;

/// Angles of joints 1 to 5, in degrees.
pub(super) type LineAngles = [f64; 5];

/// The resolution of the targets, which also sets the time between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetResolution {
    /// Whole degrees, for playback with speeds.
    Degrees,
    /// Hundredths of a degree, for a stream.
    Hundredths,
}

impl TargetResolution {
    /// The longest time between two targets of a line.
    #[must_use]
    pub const fn period(self) -> Duration {
        match self {
            Self::Degrees => MAX_SEGMENT,
            Self::Hundredths => Duration::from_millis(20),
        }
    }
}

/// The resolution of rounded angles, and the guard that they should keep to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounding {
    pub(super) resolution: TargetResolution,
    pub(super) guard: Option<Guard>,
}

/// The targets of joints 1 to 5, and their distance from the line.
pub(super) struct PlannedPose {
    pub(super) angles: [FineAngle; 5],
    pub(super) deviation_mm: f64,
    pub(super) tilt_degrees: f64,
}

impl Rounding {
    /// The targets for exact angles at this fraction of the line.
    pub(super) fn pose(&self, angles: LineAngles, path: &TipPath, share: f64) -> PlannedPose {
        let targets = match self.resolution {
            TargetResolution::Degrees => self.nearest_degrees(angles, path, share),
            TargetResolution::Hundredths => self.nearest_hundredths(angles, path, share),
        };
        PlannedPose::of(targets, path, share)
    }

    /// The targets at the end of the line. Whole degrees are those with the smallest miss: [`Self::best_degrees`].
    pub(super) fn last_pose(&self, angles: LineAngles, path: &TipPath) -> PlannedPose {
        match self.resolution {
            TargetResolution::Degrees => PlannedPose::of(self.best_degrees(angles, path, 1.0), path, 1.0),
            TargetResolution::Hundredths => self.pose(angles, path, 1.0),
        }
    }

    /// The nearest whole degrees, if they are within the limits of the arm and the guard allows them; otherwise
    /// [`Self::best_degrees`].
    fn nearest_degrees(&self, angles: LineAngles, path: &TipPath, share: f64) -> [FineAngle; 5] {
        let whole = angles.map(f64::round);
        let [t1, t2, t3, t4, t5] = whole;
        let is_allowed = self.guard.is_none_or(|guard| guard.check_pose(whole).is_ok());
        if is_allowed && check_arm([t1, t2, t3, t4, t5, 90.0]).is_ok() {
            return whole.map(in_range);
        }
        self.best_degrees(angles, path, share)
    }

    /// The nearest hundredths; [`Self::best_degrees`] if the hundredths would break a limit of the arm.
    fn nearest_hundredths(&self, angles: LineAngles, path: &TipPath, share: f64) -> [FineAngle; 5] {
        let fine = angles.map(in_range);
        let [t1, t2, t3, t4, t5] = fine.map(FineAngle::degrees);
        let is_legal = check_arm([t1, t2, t3, t4, t5, 90.0]).is_ok();
        if is_legal { fine } else { self.best_degrees(angles, path, share) }
    }

    /// Of the whole degrees beside `angles` and within the limits, those nearest to the path. Prefers degrees that the guard
    /// allows.
    fn best_degrees(&self, angles: LineAngles, path: &TipPath, share: f64) -> [FineAngle; 5] {
        let (tip, tool) = path.at(share);
        let target = TipTarget::near(angles, tip, tool, self.guard.as_ref());
        target.degrees.map(|degrees| Angle::from_register(degrees).into())
    }
}

impl PlannedPose {
    fn of(angles: [FineAngle; 5], path: &TipPath, share: f64) -> Self {
        let [t1, t2, t3, t4, t5] = angles.map(FineAngle::degrees);
        let TipPose { tip, tool, .. } = TipPose::at([t1, t2, t3, t4, t5, 90.0]);
        let tilt_degrees = angle_between(tool, path.at(share).1);
        Self { angles, deviation_mm: path.distance(tip), tilt_degrees }
    }

    pub(super) fn degrees(&self) -> LineAngles {
        self.angles.map(FineAngle::degrees)
    }
}

/// The nearest hundredth from 0 to 180 degrees.
fn in_range(degrees: f64) -> FineAngle {
    FineAngle::from_degrees(degrees.clamp(0.0, 180.0)).unwrap_or(Angle::from_register(0).into())
}
