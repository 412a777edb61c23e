//! What has to be reached.

use serde::Deserialize;

use crate::exercise::Text;
use crate::path::MOST_POINTS;

/// By default a tip is at a point within this distance, in mm.
const TIP_WITHIN: f64 = 10.0;
/// By default a tip is on a path within this distance, in mm.
const PATH_WITHIN: f64 = 8.0;
/// By default a joint is at an angle within this, in degrees.
const JOINT_WITHIN: f64 = 2.0;

const fn tip_within() -> f64 {
    TIP_WITHIN
}

const fn path_within() -> f64 {
    PATH_WITHIN
}

const fn joint_within() -> f64 {
    JOINT_WITHIN
}

/// One goal of an exercise.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub enum Goal {
    /// The tip touches a point.
    Tip {
        /// The goal in words.
        text: Text,
        /// The point: x, y, z in mm.
        tip: [f64; 3],
        /// How near, in mm.
        #[serde(default = "tip_within")]
        within: f64,
    },
    /// The tip goes along straight lines from point to point, without leaving them.
    Path {
        /// The goal in words.
        text: Text,
        /// The points: x, y, z in mm.
        path: Vec<[f64; 3]>,
        /// How near to the lines, in mm.
        #[serde(default = "path_within")]
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
        #[serde(default = "joint_within")]
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

impl Goal {
    /// The goal in words.
    #[must_use]
    pub const fn text(&self) -> &Text {
        match self {
            Self::Tip { text, .. }
            | Self::Path { text, .. }
            | Self::Joint { text, .. }
            | Self::Blocked { text, .. } => text,
        }
    }

    /// Why it can never be reached.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        let (within, is_possible, fault) = match self {
            Self::Tip { within, .. } => (*within, true, ""),
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
