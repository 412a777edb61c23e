//! The poses of the bodies of the arm, computed from the angles of its joints.

use kinematics::geometry::{FINGER_AXIS, LEVER, REAR_ARM};
use kinematics::{Frames, Vector, forward};

use crate::look::Body;

/// The axes of a body and its origin in mm, in the frame of the arm: x to the right, y forward, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The direction of the body's x axis.
    pub x: Vector<f64>,
    /// The direction of the body's y axis.
    pub y: Vector<f64>,
    /// The direction of the body's z axis.
    pub z: Vector<f64>,
    /// The position of the body's origin, in mm.
    pub origin: Vector<f64>,
}

impl Pose {
    fn new(x: Vector<f64>, y: Vector<f64>, origin: Vector<f64>) -> Self {
        Self { x, y, z: x.cross(y), origin }
    }

    /// Converts a point from the axes of the body to the frame of the arm, in mm.
    #[must_use]
    pub fn point(&self, x: f64, y: f64, z: f64) -> Vector<f64> {
        self.origin + self.x * x + self.y * y + self.z * z
    }

    /// The pose of a body with its origin at the point (x, y, 0) of this body, turned by `degrees` about the z axis of this body.
    fn turned_about_z(&self, [x, y]: [f64; 2], degrees: f64) -> Self {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let along = self.x * cosine + self.y * sine;
        Self::new(along, self.y * cosine - self.x * sine, self.point(x, y, 0.0))
    }
}

/// The poses of all bodies at these angles of joints 1 to 7, in degrees as in the registers. The claw is closed at 0 degrees
/// of joint 7; each finger turns by half of the angle of joint 7.
#[must_use]
pub fn poses([t1, t2, t3, t4, t5, t6, t7]: [f64; 7]) -> [(Body, Pose); 11] {
    let Frames { arm, hand } = forward([t1, t2, t3, t4, t5, t6]);
    let (ahead, left) = (Vector::new(0.0, 1.0, 0.0), Vector::new(-1.0, 0.0, 0.0));
    let zero = Vector::new(0.0, 0.0, 0.0);
    let rear_arm = arm.left.cross((arm.elbow - arm.shoulder) * (1.0 / REAR_ARM));
    let across = hand.bend.cross(arm.along);
    let disc = Pose::new(hand.tool, hand.disc, hand.tip);
    let [forward, aside] = FINGER_AXIS;
    [
        (Body::Base, Pose::new(ahead, left, zero)),
        (Body::Turret, Pose::new(arm.heading, arm.left, zero)),
        (Body::RearArm, Pose::new(rear_arm, arm.left, arm.shoulder)),
        (Body::Lever, Pose::new(arm.along, arm.left, arm.shoulder)),
        (Body::Rod, Pose::new(rear_arm, arm.left, arm.shoulder - arm.along * LEVER)),
        (Body::Forearm, Pose::new(arm.along, arm.left, arm.elbow)),
        (Body::Wrist, Pose::new(arm.along, across, arm.wrist)),
        (Body::Hand, Pose::new(hand.tool, across, arm.wrist)),
        (Body::Disc, disc),
        (Body::Finger, disc.turned_about_z([forward, aside], t7 / 2.0)),
        (Body::OppositeFinger, disc.turned_about_z([forward, -aside], -t7 / 2.0)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRAIGHT: [f64; 7] = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 0.0];

    #[test]
    fn in_the_straight_pose_all_bodies_have_the_axes_of_the_base() {
        let all = poses(STRAIGHT);
        let [(_, base), ..] = all;
        for ((body, pose), expected) in all.into_iter().zip(Body::ALL) {
            assert_eq!(body, expected);
            assert_eq!([pose.x, pose.y, pose.z], [base.x, base.y, base.z], "{body:?}");
        }
    }

    #[test]
    fn axes_stay_square_and_bodies_stay_joined() {
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..500 {
            let angles = [(); 7].map(|()| random.f64() * 180.0);
            let all = poses(angles);
            let pose = |wanted| all.iter().find(|(body, _)| *body == wanted).map(|(_, pose)| *pose).unwrap();
            for (body, pose) in all {
                assert!((pose.z.dot(pose.x.cross(pose.y)) - 1.0).abs() < 1e-9, "{body:?} {angles:?}");
            }
            let joined = |one: Vector<f64>, other| assert!((one - other).length() < 1e-9, "{angles:?}");
            joined(pose(Body::RearArm).point(0.0, 0.0, REAR_ARM), pose(Body::Forearm).origin);
            joined(pose(Body::Lever).point(-LEVER, 0.0, 0.0), pose(Body::Rod).origin);
            let rod_end = pose(Body::Rod).point(0.0, 0.0, REAR_ARM);
            joined(rod_end, pose(Body::Forearm).point(-LEVER, 0.0, 0.0));
            joined(pose(Body::Hand).origin, pose(Body::Wrist).origin);
            let disc_edge = pose(Body::Disc).point(0.0, kinematics::geometry::DISC_RADIUS, 0.0);
            let [t1, t2, t3, t4, t5, t6, _] = angles;
            joined(disc_edge, forward([t1, t2, t3, t4, t5, t6]).hand.disc_edge);
        }
    }

    #[test]
    fn joint_7_opens_both_fingers_outward() {
        let tips = |t7: f64| {
            let mut angles = STRAIGHT;
            angles[6] = t7;
            let [.., (_, disc), (_, one), (_, other)] = poses(angles);
            [one.point(50.0, 0.0, 0.0), other.point(50.0, 0.0, 0.0)]
                .map(|tip| (tip - disc.origin).dot(disc.y))
        };
        let ([one, other], [one_open, other_open]) = (tips(0.0), tips(60.0));
        assert!((one + other).abs() < 1e-9 && (one_open + other_open).abs() < 1e-9);
        assert!(one_open > one + 20.0, "{one} {one_open}");
    }
}
