//! The links and joints of the arm as a tree, for formats without closed loops.
//!
//! ```text
//!   base_link ─joint_1─▶ turret ─joint_2─▶ rear_arm ─elbow─▶ elbow_link ─joint_3─▶ forearm
//!     ─joint_4─▶ wrist ─joint_5─▶ hand ─joint_6─▶ disc ─▶ tip, disc_edge
//! ```
//!
//! Because of the parallelogram, joint 3 sets the angle of the forearm to the horizontal, independent of joint 2. In the tree,
//! the joint `elbow` cancels the rotation by joint 2, so `joint_3` has the angle of joint 3 of the arm.

use std::f64::consts::FRAC_PI_2;

use kinematics::geometry::{
    BASE_HEIGHT, DISC_RADIUS, ELBOW_OFFSET, FOREARM, JOINT_MAX, LEVEL_FOREARM, REAR_ARM, SHOULDER_FORWARD,
    SHOULDER_HEIGHT, TOOL,
};

use crate::TIP;

/// A point or a direction: x forward, y to the left, z up.
pub(crate) type Axes = [f64; 3];

/// Converts millimetres to metres.
pub(crate) const fn m(millimetres: f64) -> f64 {
    millimetres / 1000.0
}

/// The speed of a joint without load, in rad/s: 62 rpm.
pub(crate) const MAX_SPEED: f64 = 6.49;

/// A cylinder that represents a part, in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkCylinder {
    pub(crate) from: Axes,
    pub(crate) to: Axes,
    pub(crate) radius: f64,
}

const fn solid(from: Axes, to: Axes, radius: f64) -> LinkCylinder {
    let [x, y, z] = from;
    let [u, v, w] = to;
    LinkCylinder { from: [m(x), m(y), m(z)], to: [m(u), m(v), m(w)], radius: m(radius) }
}

/// A link, its shape, and the joint that carries it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub(crate) name: &'static str,
    pub(crate) solids: &'static [LinkCylinder],
    /// `None` for the base.
    pub(crate) joint: Option<ModelJoint>,
}

/// The joint between a link and its parent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ModelJoint {
    pub(crate) name: &'static str,
    /// The link that carries the joint.
    pub(crate) parent: &'static str,
    /// The position of the joint in its parent, in metres.
    pub(crate) origin: Axes,
    pub(crate) motion: Motion,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Motion {
    Fixed,
    /// Turns about an axis, between two angles in radians.
    Turn {
        axis: Axes,
        low: f64,
        high: f64,
    },
    /// Turns about an axis by the negative angle of the joint `of`, which has the same range.
    TurnBack {
        axis: Axes,
        of: &'static str,
    },
}

pub(crate) const UP: Axes = [0.0, 0.0, 1.0];
pub(crate) const LEFT: Axes = [0.0, 1.0, 0.0];
pub(crate) const RIGHT: Axes = [0.0, -1.0, 0.0];
pub(crate) const BACK: Axes = [-1.0, 0.0, 0.0];

const fn joint(name: &'static str, parent: &'static str, origin: Axes, motion: Motion) -> Option<ModelJoint> {
    let [x, y, z] = origin;
    Some(ModelJoint { name, parent, origin: [m(x), m(y), m(z)], motion })
}

const fn quarter_turns(axis: Axes) -> Motion {
    Motion::Turn { axis, low: -FRAC_PI_2, high: FRAC_PI_2 }
}

/// The range of joint 3 in radians.
pub(crate) const JOINT_3_LOW: f64 = -LEVEL_FOREARM.to_radians();
pub(crate) const JOINT_3_HIGH: f64 = (JOINT_MAX - LEVEL_FOREARM).to_radians();

const ORIGIN: Axes = [0.0; 3];
const SHOULDER: Axes = [SHOULDER_FORWARD, 0.0, SHOULDER_HEIGHT];
const ELBOW: Axes = [0.0, 0.0, REAR_ARM];
const WRIST: Axes = [FOREARM, 0.0, ELBOW_OFFSET];
const DISC: Axes = [TOOL, 0.0, 0.0];

// Lengths and radii that are plain numbers here are estimates.
pub(crate) const BASE_SOLIDS: &[LinkCylinder] = &[solid([0.0, 0.0, -BASE_HEIGHT], [0.0, 0.0, 0.0], 65.0)];
pub(crate) const TURRET_SOLIDS: &[LinkCylinder] = &[
    solid(ORIGIN, [0.0, 0.0, SHOULDER_HEIGHT - 15.0], 45.0),
    solid([SHOULDER_FORWARD, -35.0, SHOULDER_HEIGHT], [SHOULDER_FORWARD, 35.0, SHOULDER_HEIGHT], 20.0),
];
pub(crate) const REAR_ARM_SOLIDS: &[LinkCylinder] = &[solid(ORIGIN, ELBOW, 14.0)];
pub(crate) const FOREARM_SOLIDS: &[LinkCylinder] = &[
    solid([0.0, -20.0, 0.0], [0.0, 20.0, 0.0], 16.0),
    solid(ORIGIN, [0.0, 0.0, ELBOW_OFFSET], 14.0),
    solid([0.0, 0.0, ELBOW_OFFSET], WRIST, 14.0),
];
pub(crate) const WRIST_SOLIDS: &[LinkCylinder] = &[solid([0.0, -16.0, 0.0], [0.0, 16.0, 0.0], 12.0)];
pub(crate) const HAND_SOLIDS: &[LinkCylinder] = &[solid(ORIGIN, [TOOL - 5.0, 0.0, 0.0], 10.0)];
/// The disc, and a pin at the edge of the disc, on its y axis. The pin shows how joint 6 turns the disc.
pub(crate) const DISC_SOLIDS: &[LinkCylinder] = &[
    solid([-5.0, 0.0, 0.0], ORIGIN, DISC_RADIUS),
    solid([-5.0, DISC_RADIUS - 2.0, 0.0], [2.0, DISC_RADIUS - 2.0, 0.0], 2.0),
];

/// All links, each after its parent.
pub(crate) const LINKS: [Link; 10] = [
    Link { name: "base_link", solids: BASE_SOLIDS, joint: None },
    Link {
        name: "turret",
        solids: TURRET_SOLIDS,
        joint: joint("joint_1", "base_link", ORIGIN, quarter_turns(UP)),
    },
    Link {
        name: "rear_arm",
        solids: REAR_ARM_SOLIDS,
        joint: joint("joint_2", "turret", SHOULDER, quarter_turns(RIGHT)),
    },
    Link {
        name: "elbow_link",
        solids: &[],
        joint: joint("elbow", "rear_arm", ELBOW, Motion::TurnBack { axis: RIGHT, of: "joint_2" }),
    },
    Link {
        name: "forearm",
        solids: FOREARM_SOLIDS,
        joint: joint(
            "joint_3",
            "elbow_link",
            ORIGIN,
            Motion::Turn { axis: LEFT, low: JOINT_3_LOW, high: JOINT_3_HIGH },
        ),
    },
    Link {
        name: "wrist",
        solids: WRIST_SOLIDS,
        joint: joint("joint_4", "forearm", WRIST, quarter_turns(BACK)),
    },
    Link { name: "hand", solids: HAND_SOLIDS, joint: joint("joint_5", "wrist", ORIGIN, quarter_turns(LEFT)) },
    Link { name: "disc", solids: DISC_SOLIDS, joint: joint("joint_6", "hand", DISC, quarter_turns(BACK)) },
    Link { name: TIP, solids: &[], joint: joint("tip_joint", "disc", ORIGIN, Motion::Fixed) },
    Link {
        name: "disc_edge",
        solids: &[],
        joint: joint("disc_edge_joint", "disc", [0.0, DISC_RADIUS, 0.0], Motion::Fixed),
    },
];
