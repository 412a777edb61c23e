//! The topics of a recording: those of the node in `ros/sevenbot_ros`, and the pump.

/// All joints, as measured.
pub(crate) const JOINT_STATES: &str = "/joint_states";
/// Where joints 1 to 7 are sent.
pub(crate) const COMMANDS: &str = "/robot_joint_command";
/// Where the links are.
pub(crate) const TRANSFORMS: &str = "/tf";
/// Where the links are that no joint moves.
pub(crate) const FIXED_TRANSFORMS: &str = "/tf_static";
/// The model of the arm as URDF.
pub(crate) const DESCRIPTION: &str = "/robot_description";
/// The health of the arm.
pub(crate) const DIAGNOSTICS: &str = "/diagnostics";
/// Does the pump suck? Sent when it changes.
pub(crate) const VACUUM: &str = "/vacuum";
