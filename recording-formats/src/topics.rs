//! The topics of a recording, named as in `ros/sevenbot_ros`, and the pump.
//!
//! Stamps are times since 1970. The time of the first moment within the recording is in the metadata of a channel.

use std::collections::BTreeMap;
use std::time::Duration;

/// All joints, as measured.
pub(crate) const JOINT_STATES: &str = "/joint_states";
/// The targets of joints 1 to 7.
pub(crate) const COMMANDS: &str = "/robot_joint_command";
/// The transforms of the links that joints move.
pub(crate) const TRANSFORMS: &str = "/tf";
/// The transforms of the fixed links.
pub(crate) const FIXED_TRANSFORMS: &str = "/tf_static";
/// The model of the arm as URDF.
pub(crate) const DESCRIPTION: &str = "/robot_description";
/// The health of the arm.
pub(crate) const DIAGNOSTICS: &str = "/diagnostics";
/// Whether the pump sucks. Sent at the first moment, and when it changes.
pub(crate) const VACUUM: &str = "/vacuum";

/// A key in the metadata of the channel of [`JOINT_STATES`]: the time of the first moment in the recording, in milliseconds.
/// Absent if the time is 0.
const FIRST_TIME: &str = "sevenbot_first_time_ms";

/// The metadata of the channel of a topic, in a recording whose first moment has this time.
pub(crate) fn metadata(topic: &str, first_time: Duration) -> BTreeMap<String, String> {
    let has_time = topic == JOINT_STATES && !first_time.is_zero();
    let entry = has_time.then(|| (FIRST_TIME.to_owned(), first_time.as_millis().to_string()));
    entry.into_iter().collect()
}

/// The time of the first moment in the recording, from the metadata of a channel; 0 if the entry is absent or invalid.
pub(crate) fn first_time(metadata: &BTreeMap<String, String>) -> Duration {
    let milliseconds = metadata.get(FIRST_TIME).and_then(|text| text.parse().ok());
    Duration::from_millis(milliseconds.unwrap_or_default())
}
