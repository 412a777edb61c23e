//! Why the tip cannot go to a position, and where it can go instead, as text for users.

use std::fmt;

use kinematics::{NoSolution, ik6};

use super::guard::{Breach, Guard};
use super::nearest::nearest;
use super::{DirectionText, PointText, Vector};

/// Why a move of the tip is refused.
#[derive(Clone, Debug, PartialEq)]
pub enum TipRefusal {
    /// No angles of the joints reach the position.
    Unreachable(Unreachable),
    /// The guard of the workspace does not allow the position.
    Guarded(Box<GuardedTip>),
}

impl TipRefusal {
    /// A usual direction of the tool with which the tip may go to the requested point; `None` if there is none.
    #[must_use]
    pub fn other_tool(&self) -> Option<Vector> {
        match self {
            Self::Unreachable(reason) => reason.other_tool,
            Self::Guarded(reason) => reason.other_tool,
        }
    }

    /// The reason alone, without the requested position and the nearest point.
    #[must_use]
    pub fn reason(&self) -> String {
        match self {
            Self::Unreachable(unreachable) => unreachable.reason().to_owned(),
            Self::Guarded(guarded) => guarded.breach.to_string(),
        }
    }
}

impl fmt::Display for TipRefusal {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreachable(reason) => reason.fmt(out),
            Self::Guarded(reason) => reason.fmt(out),
        }
    }
}

impl std::error::Error for TipRefusal {}

/// A position within reach that the guard does not allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardedTip {
    /// The part of the arm that would be inside an obstacle, and how deep.
    pub breach: Breach,
    /// The requested tip, in millimetres.
    pub tip: Vector,
    /// The requested direction of the tool.
    pub tool: Vector,
    /// The nearest allowed point that a search finds with this direction of the tool, in tenths of a millimetre. `None` if it finds
    /// none.
    pub nearest: Option<Vector>,
    /// A usual direction of the tool with which the guard allows the requested point; `None` if there is none.
    pub other_tool: Option<Vector>,
}

impl GuardedTip {
    pub(super) fn because(breach: Breach, tip: Vector, tool: Vector, guard: &Guard) -> Self {
        let (nearest, other_tool) = (nearest(tip, tool, Some(guard)), other_tool(tip, Some(guard)));
        Self { breach, tip, tool, nearest, other_tool }
    }
}

impl fmt::Display for GuardedTip {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (tip, tool) = (PointText(self.tip), DirectionText(self.tool));
        write!(out, "{tip} mm with the tool {tool} is not allowed: {}", self.breach)?;
        match self.nearest {
            Some(nearest) => {
                let (point, mm) = (PointText(nearest), (nearest - self.tip).length());
                write!(out, "; the nearest allowed point is {point} mm, {mm:.1} mm away")
            }
            None => out.write_str("; no point is allowed with this tool direction"),
        }
    }
}

/// Why the arm does not reach a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unreachable {
    /// Why the inverse kinematics has no solution; [`Self::reason`] says it to a user.
    pub why: NoSolution,
    /// The requested tip, in millimetres.
    pub tip: Vector,
    /// The requested direction of the tool.
    pub tool: Vector,
    /// The nearest point within reach that a search finds with this direction of the tool, in tenths of a millimetre. The guard, if
    /// any, allows it. `None` if the search finds none, or if the requested tip is no position.
    pub nearest: Option<Vector>,
    /// A usual direction of the tool with which the tip reaches the requested point, and the guard, if any, allows it. `None` if
    /// there is none.
    pub other_tool: Option<Vector>,
}

impl Unreachable {
    pub(super) fn because(why: NoSolution, tip: Vector, tool: Vector, guard: Option<&Guard>) -> Self {
        let (nearest, other_tool) = (nearest(tip, tool, guard), other_tool(tip, guard));
        Self { why, tip, tool, nearest, other_tool }
    }

    /// The distance from the requested point to the nearest one, in millimetres; `None` if there is no nearest point.
    #[must_use]
    pub fn distance_mm(&self) -> Option<f64> {
        self.nearest.map(|nearest| (nearest - self.tip).length())
    }

    /// The reason as text, which names the parts of the arm that a user sees.
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

impl std::error::Error for Unreachable {}

/// The first of the usual directions with which the tip may be at a point: down, down and outward, outward, outward and up,
/// up.
fn other_tool(tip: Vector, guard: Option<&Guard>) -> Option<Vector> {
    let outward = Vector::new(tip.x, tip.y, 0.0).unit().unwrap_or(Vector::new(0.0, 1.0, 0.0));
    let [x, y] = [outward.x, outward.y].map(|component| (component * 100.0).round() / 100.0);
    let usual = [(0.0, -1.0), (1.0, -1.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let mut directions = usual.map(|(outward, up)| Vector::new(x * outward, y * outward, up)).into_iter();
    directions
        .find(|&tool| ik6(tip, tool).is_ok_and(|angles| guard.is_none_or(|guard| guard.is_clear(angles))))
}
