//! Forward kinematics: where every part of the arm is, from the angles of its joints.
//!
//! This file knows no limits: any angles give frames.

use crate::float::Float;
use crate::geometry::{
    DISC_RADIUS, ELBOW_OFFSET, FOREARM, LEVEL_FOREARM, LEVER, REAR_ARM, SHOULDER_FORWARD, SHOULDER_HEIGHT,
    TOOL,
};
use crate::vector::Vector;

/// Points in millimetres and directions of the arm up to the wrist, which joints 1 to 3 move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmFrames<F> {
    /// Direction of the arm seen from above: forward at 90 degrees of joint 1, to the right at 0.
    pub heading: Vector<F>,
    /// Direction to the left of the heading; level.
    pub left: Vector<F>,
    /// Direction of the forearm, from the elbow to the wrist.
    pub along: Vector<F>,
    /// Direction at right angles to the forearm, in the plane of the arm; up where the forearm is level.
    pub normal: Vector<F>,
    /// Centre of the shoulder axis.
    pub shoulder: Vector<F>,
    /// End of the lever of the parallelogram.
    pub lever: Vector<F>,
    /// Centre of the elbow axis.
    pub elbow: Vector<F>,
    /// Where the axis of the forearm begins, above the elbow.
    pub forearm: Vector<F>,
    /// Where the axes of joints 4, 5 and 6 meet.
    pub wrist: Vector<F>,
}

/// Points in millimetres and directions of the hand, which joints 4 to 6 move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandFrames<F> {
    /// The forearm's normal turned by joint 4. The hand bends in the plane of this direction and the forearm.
    pub bend: Vector<F>,
    /// Direction of the tool: from the wrist to the tip.
    pub tool: Vector<F>,
    /// Direction of the disc at 0 degrees of joint 6.
    pub disc_zero: Vector<F>,
    /// Direction of the disc at 90 degrees of joint 6.
    pub disc_right: Vector<F>,
    /// Direction of the disc at the angle of joint 6.
    pub disc: Vector<F>,
    /// Where the axis of joint 6 meets the outer face of the disc.
    pub tip: Vector<F>,
    /// Edge of the disc, in its direction.
    pub disc_edge: Vector<F>,
    /// Edge of the disc, opposite to its direction.
    pub opposite_edge: Vector<F>,
}

/// Every point and direction of the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frames<F> {
    /// Up to the wrist.
    pub arm: ArmFrames<F>,
    /// From the wrist on.
    pub hand: HandFrames<F>,
}

/// The frames of an arm with these angles of joints 1 to 6, in degrees.
#[must_use]
pub fn forward<F: Float>([t1, t2, t3, t4, t5, t6]: [F; 6]) -> Frames<F> {
    let arm = ArmFrames::of([t1, t2, t3]);
    Frames { arm, hand: HandFrames::of(&arm, [t4, t5, t6]) }
}

impl<F: Float> ArmFrames<F> {
    /// The frames at these angles of joints 1 to 3, in degrees.
    #[must_use]
    pub fn of([t1, t2, t3]: [F; 3]) -> Self {
        let zero = F::of(0.0);
        let up = Vector::new(zero, zero, F::of(1.0));
        let (sine, cosine) = t1.sin_cos();
        let heading = Vector::new(cosine, sine, zero);
        let left = Vector::new(-sine, cosine, zero);
        let (sine, cosine) = t2.sin_cos();
        let rear_arm = heading * cosine + up * sine;
        // The parallelogram makes joint 3 turn the forearm from the horizontal, whatever joint 2 does.
        let (sine, cosine) = (t3 - F::of(LEVEL_FOREARM)).sin_cos();
        let along = heading * cosine - up * sine;
        let normal = heading * sine + up * cosine;
        let shoulder = heading * F::of(SHOULDER_FORWARD) + up * F::of(SHOULDER_HEIGHT);
        let elbow = shoulder + rear_arm * F::of(REAR_ARM);
        let forearm = elbow + normal * F::of(ELBOW_OFFSET);
        let wrist = forearm + along * F::of(FOREARM);
        Self {
            heading,
            left,
            along,
            normal,
            shoulder,
            lever: shoulder - along * F::of(LEVER),
            elbow,
            forearm,
            wrist,
        }
    }
}

impl<F: Float> HandFrames<F> {
    /// The frames of a hand on `arm`, at these angles of joints 4 to 6, in degrees.
    #[must_use]
    pub fn of(arm: &ArmFrames<F>, [t4, t5, t6]: [F; 3]) -> Self {
        let (sine, cosine) = t4.sin_cos();
        let bend = arm.normal * sine - arm.left * cosine;
        let (sine, cosine) = t5.sin_cos();
        let tool = arm.along * sine + bend * cosine;
        let disc_zero = bend * sine - arm.along * cosine;
        let disc_right = disc_zero.cross(tool);
        let (sine, cosine) = t6.sin_cos();
        let disc = disc_zero * cosine + disc_right * sine;
        let tip = arm.wrist + tool * F::of(TOOL);
        let edge = disc * F::of(DISC_RADIUS);
        Self {
            bend,
            tool,
            disc_zero,
            disc_right,
            disc,
            tip,
            disc_edge: tip + edge,
            opposite_edge: tip - edge,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn v(x: f64, y: f64, z: f64) -> Vector<f64> {
        Vector::new(x, y, z)
    }

    /// The rear arm is upright, the forearm level, and the hand in line with it. All coordinates are exact, because quarter turns
    /// are exact.
    #[test]
    fn the_frames_of_the_straight_pose() {
        let Frames { arm, hand } = forward([90.0, 90.0, 65.0, 90.0, 90.0, 90.0]);
        let (right, ahead, up) = (v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 0.0, 1.0));
        assert_eq!([arm.heading, arm.left, arm.along, arm.normal], [ahead, -right, ahead, up]);
        let height = SHOULDER_HEIGHT + REAR_ARM;
        let points = [arm.shoulder, arm.lever, arm.elbow, arm.forearm, arm.wrist];
        let ahead_and_up = [
            (SHOULDER_FORWARD, SHOULDER_HEIGHT),
            (SHOULDER_FORWARD - LEVER, SHOULDER_HEIGHT),
            (SHOULDER_FORWARD, height),
            (SHOULDER_FORWARD, height + ELBOW_OFFSET),
            (SHOULDER_FORWARD + FOREARM, height + ELBOW_OFFSET),
        ];
        assert_eq!(points, ahead_and_up.map(|(y, z)| v(0.0, y, z)));
        let directions = [hand.bend, hand.tool, hand.disc_zero, hand.disc_right, hand.disc];
        assert_eq!(directions, [up, ahead, up, -right, -right]);
        let tip = arm.wrist + ahead * TOOL;
        assert_eq!(
            [hand.tip, hand.disc_edge, hand.opposite_edge],
            [0.0, -DISC_RADIUS, DISC_RADIUS].map(|x| tip + right * x)
        );
    }

    /// Half a degree more of a joint moves the part beyond that joint in the expected direction, and by the expected distance.
    #[test]
    fn each_joint_moves_its_part() {
        let small = 0.5_f64.to_radians();
        let pose = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0];
        let from = forward(pose);
        let moved = |joint: usize, part: fn(&Frames<f64>) -> Vector<f64>| {
            let mut turned = pose;
            turned[joint - 1] += 0.5;
            (part(&forward(turned)) - part(&from)) * (1.0 / small)
        };
        let assert_near =
            |moved: Vector<f64>, wanted| assert!((moved - wanted).length() < 1.5, "{moved:?} {wanted:?}");
        assert_near(moved(1, |frames| frames.arm.wrist), v(-(SHOULDER_FORWARD + FOREARM), 0.0, 0.0));
        assert_near(moved(2, |frames| frames.arm.wrist), v(0.0, -REAR_ARM, 0.0));
        assert_near(moved(3, |frames| frames.arm.wrist), v(0.0, ELBOW_OFFSET, -FOREARM));
        assert_near(moved(3, |frames| frames.arm.lever), v(0.0, 0.0, LEVER));
        assert_near(moved(4, |frames| frames.hand.bend * 100.0), v(-100.0, 0.0, 0.0));
        assert_near(moved(5, |frames| frames.hand.tip), v(0.0, 0.0, -TOOL));
        assert_near(moved(6, |frames| frames.hand.disc_edge), v(0.0, 0.0, -DISC_RADIUS));
    }
}
