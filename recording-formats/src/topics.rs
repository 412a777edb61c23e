//! The topics of a recording: those of the node in `ros/sevenbot_ros`, and the pump.
//!
//! Stamps are times since 1970. What the recording itself has as the time of its first moment is in the metadata of the channel.

use std::collections::BTreeMap;
use std::time::Duration;

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

/// In the metadata of the channel of [`JOINT_STATES`]: the time of the first moment in the recording, in milliseconds, if it is not 0.
const FIRST_TIME: &str = "sevenbot_first_time_ms";

/// The metadata of a channel of a recording that begins at this time.
pub(crate) fn metadata(topic: &str, first_time: Duration) -> BTreeMap<String, String> {
    let has_time = topic == JOINT_STATES && !first_time.is_zero();
    let entry = has_time.then(|| (FIRST_TIME.to_owned(), first_time.as_millis().to_string()));
    entry.into_iter().collect()
}

/// The time of the first moment in the recording.
pub(crate) fn first_time(metadata: &BTreeMap<String, String>) -> Duration {
    let milliseconds = metadata.get(FIRST_TIME).and_then(|text| text.parse().ok());
    Duration::from_millis(milliseconds.unwrap_or_default())
}
