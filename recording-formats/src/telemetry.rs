//! What an arm tells besides its pose, while it is recorded.

use sevenbot::FineAngle;

/// What an arm tells besides its pose. A value is `None` where the firmware does not tell it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Telemetry {
    /// Where the joints are sent, joint 1 first.
    pub targets: Option<[FineAngle; 7]>,
    /// How they move.
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
