//! The guard of the workspace: keeps the arm above a table and out of its own base.
//!
//! ```text
//!   pose ────────▶ Guard::check_pose ──▶ Breach: which part, how deep, in what
//!   JointPath ───▶ Guard::check_path ──▶ PathBreach: the deepest one, and where on the way
//!   Recording ───▶ Guard::check_recording ──▶ TimedBreach: the first one
//! ```
//!
//! [`kinematics::workspace`] holds the geometry. It does not include a suction cup or a claw: for these, raise the table by
//! their length.

use std::fmt;
use std::time::Duration;

pub use kinematics::workspace::{BASE_MARGIN, KEEP_OUT_RADIUS, KEEP_OUT_TOP};
use kinematics::{Clearance, FixedObstacle, Part, Workspace};

use crate::fine_angle::FineAngle;
use crate::recording::{Moment, Recording};

mod joint_path;

pub use joint_path::JointPath;

/// Rounding the targets to 0.01 degrees moves the tip by less than this, in mm.
const ROUNDING_MM: f64 = 0.1;

/// Refuses poses and ways that take the arm below a table or into its own base.
///
/// ```
/// use sevenbot::cartesian::Guard;
///
/// let guard = Guard::default();
/// assert!(guard.check_pose([90.0, 90.0, 65.0, 90.0, 90.0]).is_ok());
/// let below = guard.check_pose([90.0, 20.0, 140.0, 90.0, 90.0]).unwrap_err();
/// assert!(below.to_string().contains("below the table"));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guard(Workspace);

impl Guard {
    /// A guard with the table at this height in mm. The default is -60, the foot of the base.
    #[must_use]
    pub const fn above(table_mm: f64) -> Self {
        Self(Workspace { table: table_mm })
    }

    /// The height of the table, in mm.
    #[must_use]
    pub const fn table_mm(&self) -> f64 {
        self.0.table
    }

    /// Checks the angles of joints 1 to 5, in degrees. A depth of up to 0.1 mm counts as rounding and is allowed.
    ///
    /// # Errors
    /// The part that is deepest in an obstacle.
    pub fn check_pose(&self, angles: [f64; 5]) -> Result<(), Breach> {
        let breach = self.depth(angles);
        if breach.depth_mm > ROUNDING_MM { Err(breach) } else { Ok(()) }
    }

    /// Is the arm outside every obstacle at these angles of joints 1 to 5, with no allowance for rounded targets?
    pub(super) fn is_clear(&self, angles: [f64; 5]) -> bool {
        // A depth of less than a millionth of a millimetre is a rounding error of the arithmetic.
        self.depth(angles).depth_mm < 1e-6
    }

    /// Checks a way of the joints, at each 0.1 degrees of the fastest one.
    ///
    /// Between two checks no point of the arm moves by more than 1.4 mm. So between checks the arm comes at most 0.7 mm
    /// nearer to the base than at a check, and the margin round the base is 10 mm. The table is flat: the way of a point
    /// bends towards it by less than 0.001 mm between two checks.
    ///
    /// A way that begins inside an obstacle may leave it, but go no deeper.
    ///
    /// # Errors
    /// The way breaks the guard. The error is its deepest place.
    pub fn check_path(&self, path: &JointPath) -> Result<(), PathBreach> {
        let mut escape = Escape::default();
        let mut deepest: Option<PathBreach> = None;
        for (share, angles) in path.poses() {
            let Err(breach) = escape.check(self, angles) else { continue };
            if deepest.is_none_or(|deepest| breach.depth_mm > deepest.breach.depth_mm) {
                deepest = Some(PathBreach { breach, share });
            }
        }
        deepest.map_or(Ok(()), Err)
    }

    /// Checks a recording: its poses, and the ways of the joints between them.
    ///
    /// # Errors
    /// The first place that breaks the guard.
    pub fn check_recording(&self, recording: &Recording) -> Result<(), TimedBreach> {
        let mut before: Option<[f64; 5]> = None;
        for Moment { time, pose, .. } in recording.moments() {
            let [t1, t2, t3, t4, t5, ..] = pose.map(FineAngle::degrees);
            let angles = [t1, t2, t3, t4, t5];
            let way = JointPath::together(before.unwrap_or(angles), angles);
            if let Some(breach) = way.poses().find_map(|(_, pose)| self.check_pose(pose).err()) {
                return Err(TimedBreach { time, breach });
            }
            before = Some(angles);
        }
        Ok(())
    }

    fn depth(&self, angles: [f64; 5]) -> Breach {
        let Clearance { part, obstacle, mm } = self.0.clearance(angles);
        Breach { part, obstacle, depth_mm: -mm, table_mm: self.0.table }
    }
}

/// The largest depth in an obstacle that the rest of a way may have: the smallest depth so far, and 0 once the way was outside.
/// The first pose may have any depth.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Escape {
    depth_mm: Option<f64>,
}

impl Escape {
    /// Checks the next pose of the way.
    pub(super) fn check(&mut self, guard: &Guard, angles: [f64; 5]) -> Result<(), Breach> {
        let breach = guard.depth(angles);
        let allowed = self.depth_mm.unwrap_or(f64::INFINITY);
        self.depth_mm = Some(breach.depth_mm.min(allowed));
        if breach.depth_mm > allowed.max(0.0) + ROUNDING_MM { Err(breach) } else { Ok(()) }
    }
}

/// A part of the arm inside an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Breach {
    /// The part of the arm that is inside the obstacle.
    pub part: Part,
    /// The table, or the cylinder round the base.
    pub obstacle: FixedObstacle,
    /// How deep the part is in the obstacle, in mm.
    pub depth_mm: f64,
    /// The height of the table, in mm.
    pub table_mm: f64,
}

impl Breach {
    const fn part_name(&self) -> &'static str {
        match self.part {
            Part::Elbow => "the elbow",
            Part::Forearm => "the forearm",
            Part::Wrist => "the wrist",
            Part::Hand => "the hand",
            Part::Tip => "the tip",
            Part::DiscEdge => "the edge of the disc",
        }
    }
}

impl fmt::Display for Breach {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (part, depth, table) = (self.part_name(), self.depth_mm, self.table_mm);
        match self.obstacle {
            FixedObstacle::Table => {
                write!(out, "{part} would be {depth:.1} mm below the table at z = {table} mm")
            }
            FixedObstacle::Base => write!(
                out,
                "{part} would be {depth:.1} mm inside the space of the base ({KEEP_OUT_RADIUS} mm round its axis, up to \
                 {KEEP_OUT_TOP} mm above the top plate)"
            ),
        }
    }
}

impl std::error::Error for Breach {}

/// The deepest place at which a way breaks the guard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathBreach {
    /// The part, the obstacle and the depth at this place.
    pub breach: Breach,
    /// The fraction of the way's duration, 0 to 1.
    pub share: f64,
}

impl fmt::Display for PathBreach {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.share >= 1.0 {
            return write!(out, "at its end {}", self.breach);
        }
        write!(out, "after {:.0} % of the way {}", self.share * 100.0, self.breach)
    }
}

impl std::error::Error for PathBreach {}

/// The first place where a recording takes the arm into an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedBreach {
    /// The time of the moment at this place, or of the next moment if the place is between two.
    pub time: Duration,
    /// The part, the obstacle and the depth at this place.
    pub breach: Breach,
}

impl fmt::Display for TimedBreach {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "at {:.2} s {}", self.time.as_secs_f64(), self.breach)
    }
}

impl std::error::Error for TimedBreach {}

#[cfg(test)]
mod tests;
