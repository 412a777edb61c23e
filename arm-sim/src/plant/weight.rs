//! The weight of the arm: the torque of gravity on each joint in a pose.
//!
//! ```text
//!          elbow ───────────── joint 5 ── tool        T2: rear arm above the horizontal
//!         ╱        forearm                            T3 - 65: forearm below the horizontal,
//!   rear ╱                                                     independent of T2 (parallelogram)
//!       ╱                                             T4, T5: roll and pitch of the tool
//!   shoulder
//! ```
//!
//! The model has three point masses, and a fourth in the gripper. The lengths are the maker's; masses and their positions
//! are assumed, as no arm was weighed. Joints 1 (vertical axis), 6 (the tool's own axis) and 7 (the claw) carry no weight. All values are integers.
//! Servos and friction are not part of the model.

use protocol_core::registers::JOINTS;

use super::sine::{ONE, cosine, sine};

/// Shoulder to elbow, in millimetres (the maker's length a).
const REAR_ARM_MM: i64 = 120;
/// Elbow pin to the axis of the forearm, at a right angle, in millimetres (the maker's length h).
const ELBOW_OFFSET_MM: i64 = 25;
/// Elbow to joint 5, in hundredths of a millimetre (the maker's length c).
const FOREARM_CENTI_MM: i64 = 19_850;

/// The rear arm, in grams: assumed.
const REAR_ARM_G: i64 = 120;
/// Its centre of mass, from the shoulder, in millimetres: assumed in the middle.
const REAR_ARM_CENTRE_MM: i64 = 60;
/// The forearm with the servos of joints 4 and 5, in grams: assumed.
const FOREARM_G: i64 = 200;
/// Its centre of mass, from the elbow, in millimetres: assumed.
const FOREARM_CENTRE_MM: i64 = 110;
/// The tool: the servos of joints 6 and 7, and the claw or the cup, in grams: assumed.
const TOOL_G: i64 = 100;
/// Its centre of mass, from the axis of joint 5, in millimetres: assumed.
const TOOL_CENTRE_MM: i64 = 50;

/// The grip, from the axis of joint 5, in millimetres: assumed.
const GRIP_MM: i64 = 90;
/// The heaviest weight in the gripper, in grams.
pub const HEAVIEST_LOAD_G: u16 = 1_000;

/// The weight of a gram in micronewton. Grams times millimetres times this are nanonewton metres.
const GRAVITY: i64 = 9_807;

/// The moment on joint 2, in gram millimetres.
const SHOULDER: i64 = REAR_ARM_G * REAR_ARM_CENTRE_MM + (FOREARM_G + TOOL_G) * REAR_ARM_MM;
/// The moment on joint 3 along the forearm.
const FOREARM: i64 = FOREARM_G * FOREARM_CENTRE_MM + TOOL_G * FOREARM_CENTI_MM / 100;
/// The moment on joint 3 at a right angle to the forearm.
const ELBOW: i64 = (FOREARM_G + TOOL_G) * ELBOW_OFFSET_MM;
/// The moment on joints 3, 4 and 5 along the tool.
const TOOL: i64 = TOOL_G * TOOL_CENTRE_MM;
/// The angle of joint 3 at which the forearm is level, in thousandths of a degree.
const LEVEL: i64 = 65_000;

/// The torque of gravity on each joint, in micronewton metres, towards greater angles, in a pose given in
/// thousandths of a degree, with this weight in the gripper in grams.
pub(crate) fn torques(pose: [i64; JOINTS], load_g: i64) -> [i64; JOINTS] {
    let [_, rear, forearm, roll, pitch, _, _] = pose;
    let drop = forearm - LEVEL;
    let (sin_drop, cos_drop) = (sine(drop), cosine(drop));
    let (sin_roll, cos_roll) = (sine(roll), cosine(roll));
    let (sin_pitch, cos_pitch) = (sine(pitch), cosine(pitch));
    let shoulder = SHOULDER + load_g * REAR_ARM_MM;
    let forearm = FOREARM + load_g * FOREARM_CENTI_MM / 100;
    let elbow = ELBOW + load_g * ELBOW_OFFSET_MM;
    let tool = TOOL + load_g * GRIP_MM;
    // Each is a derivative of the height of the masses.
    let along = forearm * cos_drop + elbow * sin_drop;
    let tool_at_elbow = sin_pitch * cos_drop + cos_pitch * sin_roll / ONE * sin_drop;
    let tool_at_pitch = cos_pitch * sin_drop + sin_pitch * sin_roll / ONE * cos_drop;
    let tool_at_roll = cos_pitch * cos_roll / ONE * cos_drop;
    [
        0,
        torque(-shoulder * cosine(rear)),
        torque(along + tool * (tool_at_elbow / ONE)),
        torque(-tool * (tool_at_roll / ONE)),
        torque(tool * (tool_at_pitch / ONE)),
        0,
        0,
    ]
}

/// Micronewton metres, of gram millimetres in millionths.
const fn torque(moment: i64) -> i64 {
    moment / 1_000 * GRAVITY / ONE
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn pose(rear: i64, forearm: i64, roll: i64, pitch: i64) -> [i64; JOINTS] {
        [90_000, rear * 1_000, forearm * 1_000, roll * 1_000, pitch * 1_000, 90_000, 80_000]
    }

    /// The potential energy in floating point. The torques are its derivatives.
    fn energy(pose: [i64; JOINTS], load_kg: f64) -> f64 {
        let radians = |millidegrees: i64| (millidegrees as f64 / 1_000.0).to_radians();
        let [_, rear, forearm, roll, pitch, _, _] = pose.map(radians);
        let drop = forearm - 65_f64.to_radians();
        let elbow = 0.120 * rear.sin();
        let offset = 0.025 * drop.cos();
        let direction = -pitch.sin() * drop.sin() + pitch.cos() * roll.sin() * drop.cos();
        let mass_height = 0.120 * 0.060 * rear.sin()
            + 0.200 * (elbow + offset - 0.110 * drop.sin())
            + 0.100 * (elbow + offset - 0.1985 * drop.sin() + 0.050 * direction)
            + load_kg * (elbow + offset - 0.1985 * drop.sin() + 0.090 * direction);
        mass_height * 9.807
    }

    #[test]
    fn torques_are_the_derivatives_of_the_energy() {
        for (rear, forearm, roll, pitch) in
            [(90, 65, 90, 90), (30, 90, 90, 90), (120, 40, 60, 20), (60, 120, 150, 130), (0, 0, 0, 0)]
        {
            let at = pose(rear, forearm, roll, pitch);
            for (joint, load_g) in (0..JOINTS).flat_map(|joint| [(joint, 0_i32), (joint, 250)]) {
                let shifted = |by: i64| {
                    let mut shifted = at;
                    shifted[joint] += by;
                    energy(shifted, f64::from(load_g) / 1_000.0)
                };
                let slope = (shifted(-500) - shifted(500)) / 1_f64.to_radians();
                let torque = torques(at, load_g.into())[joint] as f64 / 1e6;
                assert!((torque - slope).abs() < 0.001, "joint {}: {torque} N m, not {slope}", joint + 1);
            }
        }
    }

    #[test]
    fn the_level_forearm_has_weight_and_the_upright_rear_arm_has_none() {
        let [base, rear, forearm, roll, pitch, wrist, claw] = torques(pose(90, 65, 90, 90), 0);
        assert_eq!([base, rear, roll, wrist, claw], [0; 5]);
        assert_eq!([forearm, pitch], [459_457, 49_035], "towards greater angles: down");
        assert_eq!(
            torques(pose(0, 65, 90, 90), 0)[1],
            -423_662,
            "a rear arm that leans to the front falls to the front"
        );
        assert!(torques(pose(120, 65, 90, 90), 0)[1] > 0, "a rear arm that leans back falls back");
    }
}
