//! What has to be reached.

use serde::Deserialize;

use crate::path::MOST_POINTS;
use crate::text::Text;

/// By default a tip is at a point within this distance, in mm.
const TIP_WITHIN: f64 = 10.0;
/// By default a tip is on a path within this distance, in mm.
const PATH_WITHIN: f64 = 8.0;
/// By default a joint is at an angle within this, in degrees.
const JOINT_WITHIN: f64 = 2.0;

/// By default a thing is at a place within this distance, in mm.
const THING_WITHIN: f64 = 15.0;

/// A goal in a file: one of the five kinds.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GoalInFile {
    text: Text,
    tip: Option<[f64; 3]>,
    path: Option<Vec<[f64; 3]>>,
    joint: Option<u8>,
    degrees: Option<f64>,
    blocked: Option<u8>,
    thing: Option<String>,
    at: Option<[f64; 3]>,
    within: Option<f64>,
}

/// One goal of an exercise.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "GoalInFile")]
pub enum Goal {
    /// The tip touches a point.
    Tip {
        /// The goal in words.
        text: Text,
        /// The point: x, y, z in mm.
        tip: [f64; 3],
        /// How near, in mm.
        within: f64,
    },
    /// The tip goes along straight lines from point to point, without leaving them.
    Path {
        /// The goal in words.
        text: Text,
        /// The points: x, y, z in mm.
        path: Vec<[f64; 3]>,
        /// How near to the lines, in mm.
        within: f64,
    },
    /// A joint comes to rest at an angle.
    Joint {
        /// The goal in words.
        text: Text,
        /// The joint, from 1 to 7.
        joint: u8,
        /// The angle.
        degrees: f64,
        /// How near, in degrees.
        within: f64,
    },
    /// A thing on the table stands at a place, and the arm does not carry it.
    Thing {
        /// The goal in words.
        text: Text,
        /// Its name in the scene.
        thing: String,
        /// Where its middle has to be: x, y, z in mm.
        at: [f64; 3],
        /// How near, in mm.
        within: f64,
    },
    /// A joint is blocked by an obstacle.
    Blocked {
        /// The goal in words.
        text: Text,
        /// The joint, from 1 to 7.
        blocked: u8,
    },
}

impl TryFrom<GoalInFile> for Goal {
    type Error = &'static str;

    fn try_from(found: GoalInFile) -> Result<Self, Self::Error> {
        let GoalInFile { text, tip, path, joint, degrees, blocked, thing, at, within } = found;
        match (tip, path, joint.zip(degrees), blocked, thing.zip(at)) {
            (Some(tip), None, None, None, None) => {
                Ok(Self::Tip { text, tip, within: within.unwrap_or(TIP_WITHIN) })
            }
            (None, Some(path), None, None, None) => {
                Ok(Self::Path { text, path, within: within.unwrap_or(PATH_WITHIN) })
            }
            (None, None, Some((joint, degrees)), None, None) => {
                Ok(Self::Joint { text, joint, degrees, within: within.unwrap_or(JOINT_WITHIN) })
            }
            (None, None, None, Some(blocked), None) => Ok(Self::Blocked { text, blocked }),
            (None, None, None, None, Some((thing, at))) => {
                Ok(Self::Thing { text, thing, at, within: within.unwrap_or(THING_WITHIN) })
            }
            _ => Err(
                "a goal has \"tip\", \"path\", \"joint\" with \"degrees\", \"thing\" with \"at\", or \"blocked\"",
            ),
        }
    }
}

impl Goal {
    /// The goal in words.
    #[must_use]
    pub const fn text(&self) -> &Text {
        match self {
            Self::Tip { text, .. }
            | Self::Path { text, .. }
            | Self::Joint { text, .. }
            | Self::Thing { text, .. }
            | Self::Blocked { text, .. } => text,
        }
    }

    /// Why it can never be reached.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        let (within, is_possible, fault) = match self {
            Self::Tip { within, .. } | Self::Thing { within, .. } => (*within, true, ""),
            Self::Path { path, within, .. } => {
                (*within, (2..=MOST_POINTS).contains(&path.len()), "a path has 2 to 100 points")
            }
            Self::Joint { joint, degrees, within, .. } => (
                *within,
                (1..=7).contains(joint) && (0.0..=180.0).contains(degrees),
                "use a joint from 1 to 7, and 0 to 180 degrees",
            ),
            Self::Blocked { blocked, .. } => (1.0, (1..=7).contains(blocked), "use a joint from 1 to 7"),
        };
        if !is_possible {
            return Some(fault);
        }
        (within <= 0.0).then_some("\"within\" has to be above 0")
    }
}
