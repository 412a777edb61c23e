//! The arm as MJCF for MuJoCo, with the parallelogram as a closed loop.
//!
//! ```text
//!        elbow ●──────────── forearm ──▶
//!     rear_arm ╱  ╲ 40 mm behind it: the end of the rod, held by an equality constraint
//!             ╱ rod ╲
//!   shoulder ●──────● end of the lever
//! ```
//!
//! Joint 2 turns the rear arm and joint 3 the lever, both about the shoulder. The elbow and the rod are passive.

use std::io;

use kinematics::geometry::{
    DISC_RADIUS, ELBOW_OFFSET, FOREARM, LEVER, LINKAGE_MAX, LINKAGE_MIN, REAR_ARM, SHOULDER_FORWARD,
    SHOULDER_HEIGHT, TOOL,
};

use crate::ABOUT;
use crate::chain::{
    Axes, BACK, BASE_SOLIDS, DISC_SOLIDS, FOREARM_SOLIDS, HAND_SOLIDS, JOINT_3_HIGH, JOINT_3_LOW, LEFT,
    REAR_ARM_SOLIDS, RIGHT, Solid, TURRET_SOLIDS, UP, WRIST_SOLIDS, m,
};
use crate::xml::{XmlDocument, number, triple};
use crate::{JOINT_NAMES, TIP};

const QUARTER: [f64; 2] = [-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2];
const ORIGIN: Axes = [0.0; 3];
/// The end of the lever, relative to the shoulder. The rod ends at the same distance behind the elbow.
const LEVER_END: Axes = [m(-LEVER), 0.0, 0.0];
const RADIUS: f64 = m(4.0);

/// The arm in the format of MuJoCo.
///
/// # Errors
/// None in practice: the text is written to memory.
///
/// ```
/// let text = arm_model::mjcf()?;
/// assert!(text.contains("<connect name=\"parallelogram\""));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn mjcf() -> io::Result<String> {
    let mut out = XmlDocument::new();
    out.begin("mujoco", &[text("model", "7bot_v2")])?;
    for line in ABOUT {
        out.comment(line)?;
    }
    out.comment(
        "joint_2 turns the rear arm and joint_3 the lever. The constraint `parallelogram` closes the loop of lever, rod \
         and forearm; elbow = joint_2 + joint_3, and the range of the elbow is the limit of the linkage.",
    )?;
    out.empty("compiler", &[text("angle", "radian"), text("autolimits", "true")])?;
    defaults(&mut out)?;
    out.begin("worldbody", &[])?;
    base(&mut out)?;
    out.end()?;
    equality(&mut out)?;
    actuators(&mut out)?;
    out.finish()
}

fn text(name: &'static str, value: &str) -> (&'static str, String) {
    (name, value.to_owned())
}

/// Parts of the arm do not collide with each other, but with everything else.
fn defaults(out: &mut XmlDocument) -> io::Result<()> {
    out.begin("default", &[])?;
    out.empty("joint", &[text("damping", "0.1"), text("armature", "0.01")])?;
    out.empty("geom", &[text("contype", "1"), text("conaffinity", "0"), text("type", "cylinder")])?;
    out.empty("position", &[text("kp", "50")])?;
    out.end()
}

fn base(out: &mut XmlDocument) -> io::Result<()> {
    body(out, "base_link", ORIGIN, BASE_SOLIDS)?;
    body(out, "turret", ORIGIN, TURRET_SOLIDS)?;
    hinge(out, "joint_1", UP, QUARTER)?;
    let shoulder = [m(SHOULDER_FORWARD), 0.0, m(SHOULDER_HEIGHT)];
    rear_arm(out, shoulder)?;
    lever(out, shoulder)?;
    out.end()?;
    out.end()
}

fn rear_arm(out: &mut XmlDocument, shoulder: Axes) -> io::Result<()> {
    body(out, "rear_arm", shoulder, REAR_ARM_SOLIDS)?;
    hinge(out, "joint_2", RIGHT, QUARTER)?;
    let behind = Solid { from: ORIGIN, to: LEVER_END, radius: RADIUS };
    let solids = [FOREARM_SOLIDS, &[behind]].concat();
    body(out, "forearm", [0.0, 0.0, m(REAR_ARM)], &solids)?;
    hinge(out, "elbow", LEFT, [LINKAGE_MIN, LINKAGE_MAX].map(|degrees| (degrees - 90.0).to_radians()))?;
    body(out, "wrist", [m(FOREARM), 0.0, m(ELBOW_OFFSET)], WRIST_SOLIDS)?;
    hinge(out, "joint_4", BACK, QUARTER)?;
    body(out, "hand", ORIGIN, HAND_SOLIDS)?;
    hinge(out, "joint_5", LEFT, QUARTER)?;
    body(out, "disc", [m(TOOL), 0.0, 0.0], DISC_SOLIDS)?;
    hinge(out, "joint_6", BACK, QUARTER)?;
    out.empty("site", &[text("name", TIP), ("pos", triple(ORIGIN)), text("size", "0.002")])?;
    let edge = [0.0, m(DISC_RADIUS), 0.0];
    out.empty("site", &[text("name", "disc_edge"), ("pos", triple(edge)), text("size", "0.002")])?;
    for _ in ["disc", "hand", "wrist", "forearm", "rear_arm"] {
        out.end()?;
    }
    Ok(())
}

fn lever(out: &mut XmlDocument, shoulder: Axes) -> io::Result<()> {
    body(out, "lever", shoulder, &[Solid { from: ORIGIN, to: LEVER_END, radius: RADIUS }])?;
    hinge(out, "joint_3", LEFT, [JOINT_3_LOW, JOINT_3_HIGH])?;
    let rod = Solid { from: ORIGIN, to: [0.0, 0.0, m(REAR_ARM)], radius: RADIUS };
    body(out, "rod", LEVER_END, &[rod])?;
    out.empty("joint", &[text("name", "rod_joint"), text("type", "hinge"), ("axis", triple(LEFT))])?;
    out.end()?;
    out.end()
}

/// Begins a body with its shapes.
fn body(out: &mut XmlDocument, name: &str, position: Axes, solids: &[Solid]) -> io::Result<()> {
    out.begin("body", &[text("name", name), ("pos", triple(position))])?;
    for Solid { from, to, radius } in solids {
        let ends = format!("{} {}", triple(*from), triple(*to));
        out.empty("geom", &[("fromto", ends), ("size", number(*radius))])?;
    }
    Ok(())
}

fn hinge(out: &mut XmlDocument, name: &str, axis: Axes, range: [f64; 2]) -> io::Result<()> {
    let range = range.map(number).join(" ");
    out.empty("joint", &[text("name", name), text("type", "hinge"), ("axis", triple(axis)), ("range", range)])
}

fn equality(out: &mut XmlDocument) -> io::Result<()> {
    out.begin("equality", &[])?;
    let anchor = ("anchor", triple([0.0, 0.0, m(REAR_ARM)]));
    out.empty(
        "connect",
        &[text("name", "parallelogram"), text("body1", "rod"), text("body2", "forearm"), anchor],
    )?;
    out.end()
}

fn actuators(out: &mut XmlDocument) -> io::Result<()> {
    out.begin("actuator", &[])?;
    for name in JOINT_NAMES {
        out.empty("position", &[text("name", name), text("joint", name), text("inheritrange", "1")])?;
    }
    out.end()
}
