//! The goals of an exercise.

use serde::Deserialize;

use crate::path::MOST_POINTS;
use crate::text::Text;

/// The default of `within` for a tip: its largest distance from the point, in mm.
const TIP_WITHIN: f64 = 10.0;
/// The default of `within` for a path: the largest distance of the tip from the path, in mm.
const PATH_WITHIN: f64 = 8.0;
/// The default of `within` for a joint: its largest difference from the angle, in degrees.
const JOINT_WITHIN: f64 = 2.0;

/// The default of `within` for a thing: its largest distance from the position, in mm.
const THING_WITHIN: f64 = 15.0;

/// A goal in a file. The members that are present determine which of the five kinds it is.
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

/// One goal of an exercise. Its members in the file determine its kind.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "GoalInFile")]
pub enum Goal {
    /// The tip touches a point.
    Tip {
        /// The goal in words.
        text: Text,
        /// The point: x, y, z in mm.
        tip: [f64; 3],
        /// The largest distance from the point, in mm.
        within: f64,
    },
    /// The tip follows straight lines from point to point. If it leaves the path, it has to begin again.
    Path {
        /// The goal in words.
        text: Text,
        /// From 2 to 100 points: x, y, z in mm.
        path: Vec<[f64; 3]>,
        /// The largest distance from the path, in mm.
        within: f64,
    },
    /// A joint comes to rest at an angle.
    Joint {
        /// The goal in words.
        text: Text,
        /// The joint, from 1 to 7.
        joint: u8,
        /// The angle, from 0 to 180 degrees.
        degrees: f64,
        /// The largest difference from the angle, in degrees.
        within: f64,
    },
    /// A thing on the table rests at a position, and the arm does not carry it.
    Thing {
        /// The goal in words.
        text: Text,
        /// Its name in the scene.
        thing: String,
        /// The position of its middle: x, y, z in mm.
        at: [f64; 3],
        /// The largest distance from that position, in mm.
        within: f64,
    },
    /// An obstacle blocks a joint (D27).
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

    /// The reason why a number of the goal is invalid, in English; `None` if all numbers are valid.
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
