//! The properties that differ between makes of servos.

use motion_core::servo_bus::TorqueCodes;
use protocol_core::time::Duration;

/// The properties of a make of servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ServoConfig {
    /// After power-up a servo executes no frames for this long. Real servos: about 200 ms.
    pub boot_time: Duration,
    /// The time between the last byte of a question and the first byte of its answer.
    pub return_delay: Duration,
    /// The meaning of the codes in the torque switch.
    pub torque_codes: TorqueCodes,
    /// A goal switches torque on if the torque switch was not written since the servo's start. Some servos do so.
    pub goal_starts_torque: bool,
}

impl Default for ServoConfig {
    fn default() -> Self {
        Self {
            boot_time: Duration::from_millis(200),
            return_delay: Duration::from_micros(250),
            torque_codes: TorqueCodes::default(),
            goal_starts_torque: false,
        }
    }
}
