//! Why the arm cannot follow a straight line, as text for users.

use std::fmt;

use kinematics::NoSolution;

use super::super::guard::Breach;
use super::super::refusal::Unreachable;
use super::super::{PointText, Vector};
use super::path::TipPath;

/// The point where the arm cannot follow a line, and the reason.
#[derive(Clone, Debug, PartialEq)]
pub struct StraightLineError {
    /// Distance of the point from the start, in millimetres.
    pub at_mm: f64,
    /// The length of the line, in millimetres.
    pub length_mm: f64,
    /// The position of the tip at the point, in millimetres.
    pub tip: Vector,
    /// Why the arm cannot follow the line at this point.
    pub fault: StraightLineFault,
}

/// Why the arm cannot follow a line.
#[derive(Clone, Debug, PartialEq)]
pub enum StraightLineFault {
    /// A point of the line is out of reach.
    Unreachable(Box<Unreachable>),
    /// The guard of the workspace does not allow a point of the line.
    Guarded(Breach),
    /// A joint would have to jump, because the line passes a singular position.
    Singular {
        /// The number of the joint, from 1.
        joint: u8,
        /// The necessary turn in degrees.
        degrees: f64,
    },
    /// A joint would have to turn faster than 190 degrees/s, the largest speed below the maximum (D10).
    TooFast {
        /// The number of the joint, from 1.
        joint: u8,
        /// The necessary speed in degrees/s.
        degrees_per_second: f64,
        /// The speed of the tip at which this joint could follow here, in whole mm/s.
        slower_mm_per_second: f64,
    },
}

impl StraightLineError {
    pub(super) fn new(path: &TipPath, share: f64, fault: StraightLineFault) -> Self {
        Self { at_mm: path.length * share, length_mm: path.length, tip: path.at(share).0, fault }
    }

    /// The error for an end without a valid position or direction of the tool.
    pub(super) fn at_start(why: NoSolution, tip: Vector, tool: Vector) -> Self {
        let fault = StraightLineFault::Unreachable(Box::new(Unreachable::because(why, tip, tool, None)));
        Self { at_mm: 0.0, length_mm: 0.0, tip, fault }
    }
}

impl fmt::Display for StraightLineError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { at_mm, length_mm, tip, .. } = self;
        let tip = PointText(*tip);
        write!(out, "the straight line breaks {at_mm:.0} mm from its start, of {length_mm:.0} mm: ")?;
        match &self.fault {
            StraightLineFault::Unreachable(why) => why.fmt(out),
            StraightLineFault::Guarded(breach) => write!(out, "at {tip} mm {breach}"),
            StraightLineFault::Singular { joint, degrees } => write!(
                out,
                "at {tip} mm joint {joint} would have to turn by {degrees:.0}° at once. The position is \
                 singular ({}). Another tool direction or a detour avoids it",
                singularity(*joint)
            ),
            StraightLineFault::TooFast { joint, degrees_per_second, slower_mm_per_second } => {
                write!(out, "at {tip} mm joint {joint} would have to turn at {degrees_per_second:.0} °/s")?;
                if *slower_mm_per_second >= 1.0 {
                    write!(out, "; it could follow at {slower_mm_per_second} mm/s")
                } else {
                    write!(out, ": the position is nearly singular ({})", singularity(*joint))
                }
            }
        }
    }
}

/// The kind of position at which this joint jumps.
fn singularity(joint: u8) -> &'static str {
    match joint {
        1 => "the wrist passes the axis of the base",
        4 | 5 => "the tool passes the line of the forearm, or joint 4 is at an end",
        _ => "the arm is at the end of its reach",
    }
}

impl std::error::Error for StraightLineError {}
