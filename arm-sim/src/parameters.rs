//! The parameters of the simulated arm, its joints and its servos, each with its unit and its source. The parameters of the
//! supply are in `plant/supply.rs`, of the wire in `plant/wire.rs`, of obstacles in `plant/obstacles.rs`, and a servo's times on
//! the bus in `servo/config.rs`.
//!
//! "Assumed" means that no arm was measured or weighed. Change a value here to simulate another arm.
//!
//! | servo | joints 1 to 4 | joints 5 to 7 | source |
//! | --- | --- | --- | --- |
//! | stall torque | 2450 mN m (25 kg cm) | 588 mN m (6 kg cm) | assumed: a servo of 16.5 kg cm could not lift the maker's payload of 300 g at full reach |
//! | speed without load | 372 °/s (62 rpm) | 372 °/s | the maker's register map |
//! | error for full duty | 4.3° | 4.3° | assumed |
//! | derivative time (register 22, "D") | 30 ms | 10 ms | assumed: a proportional servo alone rings with a payload |
//! | filter of the derivative | 4 ms | 4 ms | assumed |
//! | static friction | 100 mN m | 16 mN m | assumed |
//! | sliding friction | 80 mN m | 12 mN m | assumed |
//! | static friction acts below | 5 counts/s | 5 counts/s | assumed: a joint does not creep for ever |
//! | friction by load | 5 % of the torque from outside | 5 % | assumed |
//! | inertia of rotor and gear, at the joint | 10 g m² | 0.5 g m² | assumed |
//! | drag without torque | 200 mN m s/rad | 40 mN m s/rad | assumed |
//! | drag, damping | 5000 mN m s/rad | 1000 mN m s/rad | assumed |
//!
//! | protection of a servo | value | source |
//! | --- | --- | --- |
//! | overload | torque above 80 % of the stall torque for 1 s | Feetech's factory settings |
//! | heat | above 80 °C | register 13, Feetech's factory setting |
//! | voltage | below 5.0 V or above 25.0 V | registers 15 and 14, Feetech's factory settings |
//! | which of them switch the motor off | all three | register 19, Feetech's factory setting 37 (0x25) |
//! | brown-out: the servo restarts | below 4.5 V | assumed |
//! | temperature around the arm | 25 °C | assumed |
//! | final rise at 100 % torque | 200 K, by the square of the torque | assumed: 40 % torque gives a rise of 32 K |
//! | time constant of the temperature | 300 s | assumed: at 100 % torque, a servo shows more than 80 °C after 99 s |
//!
//! | arm | value | source |
//! | --- | --- | --- |
//! | base axis to shoulder, shoulder to elbow, elbow to forearm, forearm to joint 5 | 29, 120, 25, 198.5 mm | the maker's constants d, a, h and c |
//! | rear arm: mass, centre from the shoulder | 120 g, 60 mm | assumed |
//! | forearm with the servos of joints 4 and 5: mass, centre from the elbow along its axis | 200 g, 110 mm | assumed |
//! | tool: mass, centre from joint 5 | 100 g, 50 mm | assumed |
//! | grip: distance from joint 5 | 90 mm | assumed |

use protocol_core::registers::Joint;
use protocol_core::time::Duration;

/// The parameters of a make of servo. Torques are in micronewton metres, drags in micronewton metre seconds per radian,
/// inertias in gram square millimetres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ServoParameters {
    /// The torque at full duty and standstill.
    pub stall_torque: i64,
    /// The torque below which the gear does not start to turn.
    pub static_friction: i64,
    /// The torque that the gear loses while it turns.
    pub sliding_friction: i64,
    /// The drag of the gear, without torque.
    pub free_drag: i64,
    /// The drag with the windings shorted.
    pub damped_drag: i64,
    /// The inertia of rotor and gear, as the joint has to turn it.
    pub rotor_inertia: i64,
    /// The derivative time of the position control, in milliseconds: the duty grows by the change of the error in this time.
    pub derivative_ms: i64,
    /// Counts in half a turn.
    pub half_turn: i64,
    /// Counts in a thousand radians: 1000 / pi times `half_turn`, rounded.
    pub counts_per_kiloradian: i64,
}

/// Joints 1 to 4.
const LARGE: ServoParameters = ServoParameters {
    stall_torque: 2_450_000,
    static_friction: 100_000,
    sliding_friction: 80_000,
    free_drag: 200_000,
    damped_drag: 5_000_000,
    rotor_inertia: 10_000_000,
    derivative_ms: 30,
    half_turn: 850,
    counts_per_kiloradian: 270_563,
};

/// Joints 5 to 7.
const SMALL: ServoParameters = ServoParameters {
    stall_torque: 588_000,
    static_friction: 16_000,
    sliding_friction: 12_000,
    free_drag: 40_000,
    damped_drag: 1_000_000,
    rotor_inertia: 500_000,
    derivative_ms: 10,
    half_turn: 625,
    counts_per_kiloradian: 198_944,
};

impl ServoParameters {
    /// The parameters of a joint's servo.
    #[must_use]
    pub const fn of(joint: Joint) -> &'static Self {
        if joint.number() < 5 { &LARGE } else { &SMALL }
    }

    /// The same servo with its stall torque, and its own friction and drag, scaled to these percentages. Friction by load stays.
    #[must_use]
    pub const fn scaled(self, torque_percent: u16, friction_percent: u16) -> Self {
        let torque = self.stall_torque * torque_percent as i64 / 100;
        let friction = friction_percent as i64;
        Self {
            stall_torque: torque,
            static_friction: self.static_friction * friction / 100,
            sliding_friction: self.sliding_friction * friction / 100,
            free_drag: self.free_drag * friction / 100,
            damped_drag: self.damped_drag * friction / 100,
            ..self
        }
    }
}

/// Full speed without load, in thousandths of a degree per second.
pub const NO_LOAD_SPEED: i64 = 372_000;
/// The distance between set-point and position at which the motor gets full duty, in thousandths of a degree.
pub const FULL_DUTY_ERROR: i64 = 4_300;
/// The time constant of the filter of the change of the error, in milliseconds.
pub(crate) const DERIVATIVE_FILTER_MS: i64 = 4;
/// Static friction acts on a joint that turns more slowly than this.
pub(crate) const CREEP_COUNTS_PER_SECOND: i64 = 5;
/// The share of the torque from outside that the gear loses to friction, in percent.
pub(crate) const LOAD_FRICTION_PERCENT: i64 = 5;

/// A torque above this share of the stall torque is an overload, in 0.1 %.
pub(crate) const OVERLOAD: u16 = 800;
/// A servo latches an overload that lasts this many milliseconds.
pub(crate) const OVERLOAD_MS: u32 = 1_000;
/// A servo is off below this supply voltage, in 0.1 V. It starts when the voltage returns.
pub(crate) const BROWN_OUT_DECIVOLTS: u8 = 45;
/// The temperature around the arm, in thousandths of a degree Celsius.
pub(crate) const AMBIENT_MILLIDEGREES: u64 = 25_000;
/// The final rise in temperature at the stall torque, in thousandths of a degree. It grows with the square of the torque.
pub(crate) const STALL_RISE_MILLIDEGREES: u64 = 200_000;
/// The time constant of the temperature.
pub(crate) const THERMAL_TIME: Duration = Duration::from_millis(300_000);

/// From the axis of the base to the shoulder, in millimetres (the maker's length d, 29.35 mm, rounded).
pub(crate) const SHOULDER_FORWARD_MM: i64 = 29;
/// Shoulder to elbow, in millimetres (the maker's length a).
pub(crate) const REAR_ARM_MM: i64 = 120;
/// Elbow pin to the axis of the forearm, at a right angle, in millimetres (the maker's length h).
pub(crate) const ELBOW_OFFSET_MM: i64 = 25;
/// Along the axis of the forearm to joint 5, in hundredths of a millimetre (the maker's length c).
pub(crate) const FOREARM_CENTI_MM: i64 = 19_850;
/// Mass of the rear arm, in grams.
pub const REAR_ARM_G: i64 = 120;
/// Distance of the rear arm's centre of mass from the shoulder, in millimetres.
pub const REAR_ARM_CENTRE_MM: i64 = 60;
/// Mass of the forearm with the servos of joints 4 and 5, in grams.
pub const FOREARM_G: i64 = 200;
/// Distance of the forearm's centre of mass from the elbow along the forearm, in millimetres.
pub const FOREARM_CENTRE_MM: i64 = 110;
/// Mass of the tool (the servos of joints 6 and 7, and the claw or the cup), in grams.
pub const TOOL_G: i64 = 100;
/// Distance of the tool's centre of mass from the axis of joint 5, in millimetres.
pub const TOOL_CENTRE_MM: i64 = 50;
/// Distance of the grip from the axis of joint 5, in millimetres.
pub(crate) const GRIP_MM: i64 = 90;
