//! The inertia of the arm about each joint in a pose.
//!
//! The masses and lengths are the same as in [`weight`](super::weight). A joint sees the other joints as rigid: a joint that
//! accelerates does not turn its neighbours. All values are integers.

use protocol_core::registers::JOINTS;

use super::pose::JointSines;
use super::sine::ONE;
use crate::parameters::{
    ELBOW_OFFSET_MM, FOREARM_CENTI_MM, FOREARM_CENTRE_MM, FOREARM_G, GRIP_MM, REAR_ARM_CENTRE_MM, REAR_ARM_G,
    REAR_ARM_MM, SHOULDER_FORWARD_MM, TOOL_CENTRE_MM, TOOL_G,
};

/// A mass of the arm, and its position in the frame of the forearm in mm: along the forearm, at a right angle to it in the
/// plane of the arm, and to the side.
struct Mass {
    grams: i64,
    along: i64,
    across: i64,
    aside: i64,
}

/// The inertia of the arm about each joint, without the joint's servo, in gram square millimetres. `load_g` is the weight in
/// the gripper in grams.
pub(crate) fn inertias(pose: JointSines, load_g: i64) -> [i64; JOINTS] {
    let JointSines { rear, drop, roll, pitch } = pose;
    let at_tool = |grams, distance| Mass {
        grams,
        along: FOREARM_CENTI_MM / 100 + distance * pitch.sin / ONE,
        across: ELBOW_OFFSET_MM + distance * pitch.cos / ONE * roll.sin / ONE,
        aside: distance * pitch.cos / ONE * roll.cos / ONE,
    };
    let fore = Mass { grams: FOREARM_G, along: FOREARM_CENTRE_MM, across: ELBOW_OFFSET_MM, aside: 0 };
    let masses = [fore, at_tool(TOOL_G, TOOL_CENTRE_MM), at_tool(load_g, GRIP_MM)];
    let sum =
        |square: &dyn Fn(&Mass) -> i64| masses.iter().map(|mass| mass.grams * square(mass)).sum::<i64>();

    let elbow = SHOULDER_FORWARD_MM + REAR_ARM_MM * rear.cos / ONE;
    let rear_centre = SHOULDER_FORWARD_MM + REAR_ARM_CENTRE_MM * rear.cos / ONE;
    let forward = |mass: &Mass| elbow + (mass.along * drop.cos + mass.across * drop.sin) / ONE;
    let base = REAR_ARM_G * rear_centre * rear_centre
        + sum(&|mass| forward(mass) * forward(mass) + mass.aside * mass.aside);
    let shoulder = REAR_ARM_G * REAR_ARM_CENTRE_MM * REAR_ARM_CENTRE_MM + sum(&|_| REAR_ARM_MM * REAR_ARM_MM);
    let elbow = sum(&|mass| mass.along * mass.along + mass.across * mass.across);
    let tool = TOOL_G * TOOL_CENTRE_MM * TOOL_CENTRE_MM + load_g * GRIP_MM * GRIP_MM;
    let roll = tool * pitch.cos / ONE * pitch.cos / ONE;
    [base, shoulder, elbow, roll, tool, 0, 0]
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn pose(rear: i64, forearm: i64, roll: i64, pitch: i64) -> JointSines {
        JointSines::of([90_000, rear * 1_000, forearm * 1_000, roll * 1_000, pitch * 1_000, 90_000, 80_000])
    }

    #[test]
    fn a_stretched_arm_with_a_payload_has_the_greatest_inertia() {
        let [base, shoulder, elbow, roll, pitch, wrist, claw] = inertias(pose(0, 65, 90, 90), 300);
        // 120 g at 89 mm, 200 g at 259 mm, 100 g at 397 mm, 300 g at 437 mm.
        assert_eq!(base / 1_000_000, 87);
        assert_eq!(shoulder, 120 * 3_600 + 600 * 14_400);
        // 200 g at 113 mm, 100 g at 249 mm, 300 g at 289 mm.
        assert_eq!(elbow / 1_000_000, 33);
        assert_eq!(pitch, 100 * 2_500 + 300 * 8_100);
        assert_eq!([roll, wrist, claw], [0; 3], "they lie on the axis");
    }

    #[test]
    fn a_tool_at_a_right_angle_has_inertia_about_the_forearm() {
        let [_, _, _, roll, pitch, ..] = inertias(pose(90, 65, 90, 0), 0);
        assert_eq!([roll, pitch], [250_000; 2]);
    }
}
