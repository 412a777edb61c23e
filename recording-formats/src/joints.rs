//! The joints with their names in `ros/sevenbot_ros`, and conversions between the angles of the arm and of its model.

use arm_model::{JOINT_NAMES, ZERO_DEGREES, joint_angles};
use sevenbot::{FineAngle, Joint};

/// The claw: its angle is 0 when it is closed.
const CLAW: &str = "joint_7";
/// The joints that follow another one in the model: the name, the index of the other joint, and the factor.
const PASSIVE: [(&str, usize, f64); 3] =
    [("elbow", 1, -1.0), ("finger", 6, 0.5), ("opposite_finger", 6, -0.5)];

/// The names of joints 1 to 7.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    JOINT_NAMES.into_iter().chain([CLAW])
}

/// The names of joints 1 to 7, and of the joints that follow them.
pub(crate) fn all_names() -> impl Iterator<Item = &'static str> {
    names().chain(PASSIVE.map(|(name, ..)| name))
}

/// Converts a pose of the arm to the angles of the model, in radians.
pub(crate) fn to_radians(pose: [FineAngle; 7]) -> [f64; 7] {
    let [t1, t2, t3, t4, t5, t6, t7] = pose.map(FineAngle::degrees);
    let [a1, a2, a3, a4, a5, a6] = joint_angles([t1, t2, t3, t4, t5, t6]);
    [a1, a2, a3, a4, a5, a6, t7.to_radians()]
}

/// Converts an angle of the model in radians to the angle of the arm in degrees.
pub(crate) fn to_degrees(joint: Joint, radians: f64) -> f64 {
    radians.to_degrees() + ZERO_DEGREES.get(usize::from(joint.index())).copied().unwrap_or_default()
}

/// Adds the values of the joints that follow to angles or speeds of joints 1 to 7.
pub(crate) fn with_passive(values: [f64; 7]) -> Vec<f64> {
    let passive = PASSIVE.map(|(_, of, factor)| factor * values.get(of).copied().unwrap_or_default());
    values.into_iter().chain(passive).collect()
}
