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
//! The model has three point masses, and a fourth in the gripper. Lengths and masses are in
//! [`parameters`](crate::parameters). Joints 1 (vertical axis), 6 (the tool's own axis) and 7 (the claw) carry no weight.
//! All values are integers. Servos and friction are not part of the model.

use protocol_core::registers::JOINTS;

use super::pose::JointSines;
use super::sine::ONE;
use crate::parameters::{
    ELBOW_OFFSET_MM, FOREARM_CENTI_MM, FOREARM_CENTRE_MM, FOREARM_G, GRIP_MM, REAR_ARM_CENTRE_MM, REAR_ARM_G,
    REAR_ARM_MM, TOOL_CENTRE_MM, TOOL_G,
};

/// The heaviest weight in the gripper, in grams.
pub const HEAVIEST_LOAD_G: u16 = 1_000;

/// The weight of a gram, in micronewtons. Grams times millimetres times this are nanonewton metres.
const GRAVITY: i64 = 9_807;

/// Sum of mass times distance about joint 2, along the rear arm, in gram millimetres.
const SHOULDER: i64 = REAR_ARM_G * REAR_ARM_CENTRE_MM + (FOREARM_G + TOOL_G) * REAR_ARM_MM;
/// The same sum about joint 3, along the forearm.
const FOREARM: i64 = FOREARM_G * FOREARM_CENTRE_MM + TOOL_G * FOREARM_CENTI_MM / 100;
/// The same sum about joint 3, at a right angle to the forearm.
const ELBOW: i64 = (FOREARM_G + TOOL_G) * ELBOW_OFFSET_MM;
/// The same sum about joints 3, 4 and 5, along the tool.
const TOOL: i64 = TOOL_G * TOOL_CENTRE_MM;
/// The torque of gravity on each joint in micronewton metres, positive towards greater angles. `load_g` is the weight in the
/// gripper in grams.
pub(crate) fn torques(pose: JointSines, load_g: i64) -> [i64; JOINTS] {
    let JointSines { rear, drop, roll, pitch } = pose;
    let shoulder = SHOULDER + load_g * REAR_ARM_MM;
    let forearm = FOREARM + load_g * FOREARM_CENTI_MM / 100;
    let elbow = ELBOW + load_g * ELBOW_OFFSET_MM;
    let tool = TOOL + load_g * GRIP_MM;
    // Each torque is a derivative of the potential energy of the masses.
    let along = forearm * drop.cos + elbow * drop.sin;
    let tool_at_elbow = pitch.sin * drop.cos + pitch.cos * roll.sin / ONE * drop.sin;
    let tool_at_pitch = pitch.cos * drop.sin + pitch.sin * roll.sin / ONE * drop.cos;
    let tool_at_roll = pitch.cos * roll.cos / ONE * drop.cos;
    [
        0,
        torque(-shoulder * rear.cos),
        torque(along + tool * (tool_at_elbow / ONE)),
        torque(-tool * (tool_at_roll / ONE)),
        torque(tool * (tool_at_pitch / ONE)),
        0,
        0,
    ]
}

/// Converts a moment from millionths of a gram millimetre to micronewton metres.
const fn torque(moment: i64) -> i64 {
    moment / 1_000 * GRAVITY / ONE
}

#[cfg(test)]
mod tests {
    use protocol_core::registers::Joint;

    use super::*;
    use crate::parameters::{LOAD_FRICTION_PERCENT, ServoParameters};

    const fn pose(rear: i64, forearm: i64, roll: i64, pitch: i64) -> [i64; JOINTS] {
        [90_000, rear * 1_000, forearm * 1_000, roll * 1_000, pitch * 1_000, 90_000, 80_000]
    }

    /// The potential energy in joules, in floating point. The torques are its derivatives.
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
                let torque = torques(JointSines::of(at), load_g.into())[joint] as f64 / 1e6;
                assert!((torque - slope).abs() < 0.001, "joint {}: {torque} N m, not {slope}", joint + 1);
            }
        }
    }

    #[test]
    fn the_makers_payload_is_lifted_with_at_most_65_percent_of_the_stall_torque_in_every_legal_pose() {
        let grid = || (0..=180).step_by(6);
        let mut highest = [0; JOINTS];
        for (rear, forearm) in grid().flat_map(|rear| grid().map(move |forearm| (rear, forearm))) {
            if !(19..=161).contains(&(forearm - 65 + rear)) {
                continue;
            }
            for (roll, pitch) in grid().flat_map(|roll| grid().map(move |pitch| (roll, pitch))) {
                let torques = torques(JointSines::of(pose(rear, forearm, roll, pitch)), 300);
                for ((highest, torque), joint) in highest.iter_mut().zip(torques).zip(Joint::ALL) {
                    let servo = ServoParameters::of(joint);
                    let friction = servo.sliding_friction + torque.abs() * LOAD_FRICTION_PERCENT / 100;
                    *highest = ((torque.abs() + friction) * 1_000 / servo.stall_torque).max(*highest);
                }
            }
        }
        assert_eq!(highest, [32, 365, 597, 167, 580, 20, 20]);
    }

    #[test]
    fn the_level_forearm_has_weight_and_the_upright_rear_arm_has_none() {
        let [base, rear, forearm, roll, pitch, wrist, claw] =
            torques(JointSines::of(pose(90, 65, 90, 90)), 0);
        assert_eq!([base, rear, roll, wrist, claw], [0; 5]);
        assert_eq!([forearm, pitch], [459_457, 49_035], "towards greater angles: down");
        assert_eq!(
            torques(JointSines::of(pose(0, 65, 90, 90)), 0)[1],
            -423_662,
            "a rear arm that leans to the front falls to the front"
        );
        assert!(
            torques(JointSines::of(pose(120, 65, 90, 90)), 0)[1] > 0,
            "a rear arm that leans back falls back"
        );
    }
}
