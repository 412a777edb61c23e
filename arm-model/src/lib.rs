//! The model of a 7Bot V2 arm for robotics programs, from the geometry of [`kinematics`].
//!
//! ```text
//!   kinematics::geometry ──▶ chain: links and joints ──▶ urdf: a tree, the elbow by a mimic joint
//!                   │               │                └──▶ glb: nodes with meshes, in the straight pose
//!                   │               └── the same ────▶ mjcf: the parallelogram closed by an equality constraint
//!                   │               └── the same ────▶ transforms: where each link is in its parent
//!                   └──▶ look: meshes of the bodies; pose: where they are, for programs that draw the arm
//! ```
//!
//! Lengths are metres and angles radians, axes as in REP-103: x forward, y to the left, z up. But meshes of [`Body`] are in
//! millimetres, and [`poses`] has the units and the frame of [`kinematics`]. All angles of the joints are 0 in the straight pose:
//! the arm forward, the rear arm upright, forearm and hand level. In this pose all links have the axes of the base.
//! [`joint_angles`] converts the degrees of the registers.
//!
//! Shapes of URDF and MJCF are cylinders along the axes of the parts; shapes of glTF are meshes as in [`Body`]. Dimensions of
//! shapes that [`kinematics::geometry`] does not define are estimates. The three models leave out joint 7, the claw, which
//! moves no point of the kinematics.
//!
//! ```
//! let urdf = arm_model::urdf()?;
//! assert!(urdf.contains("joint_1") && urdf.contains(arm_model::TIP));
//! # Ok::<(), std::io::Error>(())
//! ```

#![forbid(unsafe_code)]

mod chain;
mod glb;
mod look;
mod mesh;
mod mjcf;
mod pose;
mod transforms;
mod urdf;
mod xml;

pub use glb::glb;
pub use look::Body;
pub use mesh::{Finish, Mesh};
pub use mjcf::mjcf;
pub use pose::{Pose, poses};
pub use transforms::{LinkTransform, link_transforms};
pub use urdf::urdf;

/// The angles of joints 1 to 6 in degrees, as the registers have them, at which all joints of the model are 0.
pub const ZERO_DEGREES: [f64; 6] = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0];

/// The names of joints 1 to 6 in URDF and MJCF. The nodes of glTF have the names of the links.
pub const JOINT_NAMES: [&str; 6] = ["joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6"];

/// The name of the link at the tip of the tool; in MJCF, of a site. Its x axis points along the tool.
pub const TIP: &str = "tip";

/// Converts the angles of joints 1 to 6 from the degrees of the registers to the radians of the model.
///
/// ```
/// let angles = arm_model::joint_angles([180.0, 90.0, 65.0, 90.0, 90.0, 90.0]);
/// assert_eq!(angles, [std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// ```
#[must_use]
pub fn joint_angles(degrees: [f64; 6]) -> [f64; 6] {
    let mut angles = degrees;
    for (angle, zero) in angles.iter_mut().zip(ZERO_DEGREES) {
        *angle = (*angle - zero).to_radians();
    }
    angles
}

/// The description that each format contains as a comment or a note.
const ABOUT: [&str; 4] = [
    "7Bot V2 arm, written by `sevenbot model`. Metres and radians; x forward, y to the left, z up (REP-103).",
    "A joint's angle is (register - zero) degrees in radians. Zeros of joints 1 to 6: 90 90 65 90 90 90.",
    "Dimensions are those of the maker's kinematics. Shapes are symbolic, and masses are not measured.",
    "Joint 7, the claw, moves no point and is left out.",
];
