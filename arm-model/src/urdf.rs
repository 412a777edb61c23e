//! The arm as URDF: a tree of links, with the elbow as a mimic joint.

use std::io;

use crate::ABOUT;
use crate::chain::{Axes, LINKS, Link, LinkCylinder, MAX_SPEED, ModelJoint, Motion};
use crate::xml::{XmlDocument, number, triple};

/// The torque limit, which URDF requires, in Nm. Assumed: the stall torque of the servos is not measured.
const EFFORT: f64 = 2.0;

/// The arm in the Unified Robot Description Format.
///
/// # Errors
/// The text cannot be written. This does not happen in practice, because it is written to memory.
///
/// ```
/// let text = arm_model::urdf()?;
/// assert!(text.contains("<joint name=\"joint_1\" type=\"revolute\">"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn urdf() -> io::Result<String> {
    let mut out = XmlDocument::new();
    out.begin("robot", &[("name", "7bot_v2".to_owned())])?;
    for line in ABOUT {
        out.comment(line)?;
    }
    out.comment(
        "The arm has a parallelogram, which URDF cannot close: joint_3 turns the forearm from the horizontal. The joint \
         `elbow` is computed, elbow = -joint_2 (mimic), so joint_3 has the angle of the arm.",
    )?;
    out.comment(
        "URDF cannot limit two joints together. The arm keeps joint_2 + joint_3 within -71 to 71 degrees.",
    )?;
    for link in &LINKS {
        write_link(&mut out, link)?;
        if let Some(joint) = &link.joint {
            write_joint(&mut out, joint, link.name)?;
        }
    }
    out.finish()
}

fn write_link(out: &mut XmlDocument, link: &Link) -> io::Result<()> {
    let name = [("name", link.name.to_owned())];
    if link.solids.is_empty() {
        return out.empty("link", &name);
    }
    out.begin("link", &name)?;
    for solid in link.solids {
        for element in ["visual", "collision"] {
            out.begin(element, &[])?;
            write_solid(out, solid)?;
            out.end()?;
        }
    }
    out.end()
}

/// Writes a cylinder. In URDF its axis is z, so a rotation turns it to the axis of the solid.
fn write_solid(out: &mut XmlDocument, solid: &LinkCylinder) -> io::Result<()> {
    let [x, y, z] = between(solid.from, solid.to, |from, to| to - from);
    let middle = between(solid.from, solid.to, |from, to| (from + to) / 2.0);
    let length = x.hypot(y).hypot(z);
    let (pitch, yaw) = (x.hypot(y).atan2(z), y.atan2(x));
    out.empty("origin", &[("xyz", triple(middle)), ("rpy", triple([0.0, pitch, yaw]))])?;
    out.begin("geometry", &[])?;
    out.empty("cylinder", &[("radius", number(solid.radius)), ("length", number(length))])?;
    out.end()
}

fn between(from: Axes, to: Axes, mix: impl Fn(f64, f64) -> f64) -> Axes {
    let ([x, y, z], [u, v, w]) = (from, to);
    [mix(x, u), mix(y, v), mix(z, w)]
}

fn write_joint(out: &mut XmlDocument, joint: &ModelJoint, child: &str) -> io::Result<()> {
    let kind = if matches!(joint.motion, Motion::Fixed) { "fixed" } else { "revolute" };
    out.begin("joint", &[("name", joint.name.to_owned()), ("type", kind.to_owned())])?;
    out.empty("parent", &[("link", joint.parent.to_owned())])?;
    out.empty("child", &[("link", child.to_owned())])?;
    out.empty("origin", &[("xyz", triple(joint.origin)), ("rpy", triple([0.0; 3]))])?;
    let quarter = std::f64::consts::FRAC_PI_2;
    match joint.motion {
        Motion::Fixed => {}
        Motion::Turn { axis, low, high } => write_turn(out, axis, [low, high])?,
        Motion::TurnBack { axis, of } => {
            write_turn(out, axis, [-quarter, quarter])?;
            out.empty(
                "mimic",
                &[("joint", of.to_owned()), ("multiplier", number(-1.0)), ("offset", number(0.0))],
            )?;
        }
    }
    out.end()
}

fn write_turn(out: &mut XmlDocument, axis: Axes, [low, high]: [f64; 2]) -> io::Result<()> {
    out.empty("axis", &[("xyz", triple(axis))])?;
    let limit = [("lower", low), ("upper", high), ("effort", EFFORT), ("velocity", MAX_SPEED)];
    out.empty("limit", &limit.map(|(name, value)| (name, number(value))))
}
