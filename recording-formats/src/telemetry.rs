//! The values that an arm reports besides its pose, while it is recorded.

use sevenbot::FineAngle;

/// The values that an arm reports besides its pose. A value is `None` if it is not recorded, or if the firmware does not have it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Telemetry {
    /// The target positions, joint 1 first.
    pub targets: Option<[FineAngle; 7]>,
    /// The velocities and loads: both or none.
    pub motion: Option<JointMotion>,
}

/// Velocities and loads, joint 1 first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion {
    /// In degrees per second, positive towards greater angles.
    pub velocities: [f64; 7],
    /// In percent of the stall torque, positive if the motor pushes towards greater angles.
    pub loads: [f64; 7],
}
