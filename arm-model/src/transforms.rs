//! The transform of each link relative to its parent, for ROS (`/tf`).

use crate::JOINT_NAMES;
use crate::chain::{LINKS, Motion};

/// The position and the rotation of a link relative to its parent, the link that carries it.
///
/// ```
/// let links: Vec<_> = arm_model::link_transforms([0.1, 0.2, 0.0, 0.0, 0.0, 0.0]).collect();
/// assert_eq!((links[0].parent, links[0].child), ("base_link", "turret"));
/// // Joint 1 turns about z, by 0.1 rad.
/// assert_eq!(links[0].rotation, [0.0, 0.0, 0.05f64.sin(), 0.05f64.cos()]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkTransform {
    /// The name of the link that carries this link.
    pub parent: &'static str,
    /// The name of this link.
    pub child: &'static str,
    /// The position of its origin in the parent, in m.
    pub translation: [f64; 3],
    /// Its rotation in the parent, as a unit quaternion: x, y, z, w.
    pub rotation: [f64; 4],
    /// Is the transform the same at all angles of the joints?
    pub is_fixed: bool,
}

/// The transforms of all links but the base, with joints 1 to 6 of the model at these angles in radians. Parents come first.
/// [`crate::joint_angles`] converts the degrees of the registers to these angles.
pub fn link_transforms(angles: [f64; 6]) -> impl Iterator<Item = LinkTransform> {
    LINKS.iter().filter_map(move |link| {
        let joint = link.joint?;
        Some(LinkTransform {
            parent: joint.parent,
            child: link.name,
            translation: joint.origin,
            rotation: rotation(joint.name, joint.motion, &angles),
            is_fixed: matches!(joint.motion, Motion::Fixed),
        })
    })
}

fn rotation(joint: &str, motion: Motion, angles: &[f64; 6]) -> [f64; 4] {
    let angle_of = |wanted: &str| {
        JOINT_NAMES.iter().zip(angles).find(|(name, _)| **name == wanted).map(|(_, angle)| *angle)
    };
    let (axis, angle) = match motion {
        Motion::Fixed => return [0.0, 0.0, 0.0, 1.0],
        Motion::Turn { axis, .. } => (axis, angle_of(joint)),
        Motion::TurnBack { axis, of } => (axis, angle_of(of).map(|angle| -angle)),
    };
    let (sine, cosine) = (angle.unwrap_or_default() / 2.0).sin_cos();
    let [x, y, z] = axis;
    [x * sine, y * sine, z * sine, cosine]
}
