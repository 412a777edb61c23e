//! An independent solver agrees: `rs-opw-kinematics`, for arms with six joints and a spherical wrist.
//!
//! Its model has the dimensions of this arm, but no parallelogram: each joint turns all parts beyond it. So the model's third
//! angle is the linkage, and all its angles are 0 for the upright arm. The solver does not check the limits of this arm.
//!
//! ```text
//!   q1 = T1   q2 = 90 - T2   q3 = linkage(T2, T3)   q4 = 90 - T4   q5 = T5 - 90   q6 = -T6
//! ```

use crate::common::legal_poses;
use fastrand::Rng;
use kinematics::geometry::{
    ELBOW_OFFSET, FOREARM, LEVEL_FOREARM, LINKAGE_MAX, LINKAGE_MIN, REAR_ARM, SHOULDER_FORWARD,
    SHOULDER_HEIGHT, TOOL,
};
use kinematics::limits::linkage;
use kinematics::{Vector, forward, ik7};
use rs_opw_kinematics::glam::{DMat3, DQuat, DVec3};
use rs_opw_kinematics::kinematic_traits::{Kinematics, Pose};
use rs_opw_kinematics::kinematics_impl::OPWKinematics;
use rs_opw_kinematics::parameters::opw_kinematics::Parameters;

const POSES: usize = 20_000;
/// Within this distance from a limit, in degrees, the two solvers may disagree.
const MARGIN: f64 = 0.001;

fn witness() -> OPWKinematics {
    OPWKinematics::new(Parameters {
        a1: SHOULDER_FORWARD,
        a2: -ELBOW_OFFSET,
        b: 0.0,
        c1: SHOULDER_HEIGHT,
        c2: REAR_ARM,
        c3: FOREARM,
        c4: TOOL,
        offsets: [0.0; 6],
        sign_corrections: [1; 6],
        dof: 6,
    })
}

fn to_witness([t1, t2, t3, t4, t5, t6]: [f64; 6]) -> [f64; 6] {
    [t1, 90.0 - t2, linkage(t2, t3), 90.0 - t4, t5 - 90.0, -t6].map(f64::to_radians)
}

/// Angles of joints 1 to 6 in the turn from -90 to 270 degrees; joint 3 follows from the linkage, joint 6 is modulo
/// 180.
fn from_witness(angles: [f64; 6]) -> [f64; 6] {
    let [q1, q2, q3, q4, q5, q6] = angles.map(f64::to_degrees);
    let wrapped = |degrees: f64| (degrees + 90.0).rem_euclid(360.0) - 90.0;
    let t2 = wrapped(90.0 - q2);
    let t3 = wrapped(q3) + LEVEL_FOREARM - t2;
    [wrapped(q1), t2, t3, wrapped(90.0 - q4), wrapped(q5 + 90.0), (-q6).rem_euclid(180.0)]
}

/// Does a solution keep all limits, each with this margin in degrees?
fn is_legal([t1, t2, t3, t4, t5, _]: [f64; 6], to_spare: f64) -> bool {
    let is_within = |angle: f64, least: f64, most: f64| angle >= least + to_spare && angle <= most - to_spare;
    [t1, t2, t3, t4, t5].iter().all(|&angle| is_within(angle, 0.0, 180.0))
        && is_within(linkage(t2, t3), LINKAGE_MIN, LINKAGE_MAX)
}

fn glam(vector: Vector<f64>) -> DVec3 {
    DVec3::new(vector.x, vector.y, vector.z)
}

/// The pose of the tip in the axes of the witness: x is opposite to the direction of the disc, z is along the tool.
fn pose(angles: [f64; 6]) -> Pose {
    let hand = forward(angles).hand;
    let (x, z) = (-glam(hand.disc), glam(hand.tool));
    Pose::from_parts(glam(hand.tip), DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)))
}

/// The largest difference of two solutions in degrees, joint 6 modulo 180.
fn difference(a: [f64; 6], b: [f64; 6]) -> f64 {
    let around = (a[5] - b[5]).abs();
    a.iter().zip(b).take(5).map(|(a, b)| (a - b).abs()).fold(around.min(180.0 - around), f64::max)
}

#[test]
fn forward_kinematics_agree() {
    let witness = witness();
    for angles in legal_poses(3).take(POSES) {
        let (ours, theirs) = (pose(angles), witness.forward(&to_witness(angles)));
        assert!(ours.translation.distance(theirs.translation) < 1e-9, "{angles:?}");
        assert!(ours.rotation.angle_between(theirs.rotation) < 1e-6, "{angles:?}");
    }
}

/// Poses with joints 1 to 3 up to 10 degrees beyond their limits, and joints 4 to 6 all the way round. Many poses break
/// limits. Some of these have another solution that breaks none.
#[test]
fn a_pose_is_solved_exactly_if_the_witness_has_a_legal_solution() {
    let witness = witness();
    let mut random = Rng::with_seed(4);
    let (mut solved, mut refused) = (0, 0);
    for _ in 0..4 * POSES {
        // Joints 1 to 3 have a range of only 200 degrees, so that enough poses are legal.
        let angles = std::array::from_fn(|joint| {
            random.f64() * [200.0, 200.0, 200.0, 360.0, 360.0, 360.0][joint] - 10.0
        });
        let theirs: Vec<_> = witness.inverse(&pose(angles)).into_iter().map(from_witness).collect();
        let hand = forward(angles).hand;
        match ik7(hand.tip, hand.tool, hand.disc) {
            Ok(ours) => {
                let nearest = theirs.iter().map(|&theirs| difference(ours, theirs)).fold(f64::MAX, f64::min);
                assert!(nearest < 0.001, "{angles:?}: {ours:?} is none of {theirs:?}");
                solved += 1;
            }
            Err(why) => {
                let missed = theirs.iter().find(|&&theirs| is_legal(theirs, MARGIN));
                assert_eq!(missed, None, "{angles:?}: {why:?}");
                refused += 1;
            }
        }
    }
    println!("{solved} solved, {refused} refused");
    assert!(solved > POSES / 2 && refused > POSES / 2);
}

/// For each legal pose, the witness has at most one solution that keeps all limits.
#[test]
fn a_legal_pose_has_no_second_solution() {
    let witness = witness();
    for angles in legal_poses(5).take(POSES) {
        let theirs = witness.inverse(&pose(angles)).into_iter().map(from_witness);
        let mut legal: Vec<_> = theirs.filter(|&theirs| is_legal(theirs, MARGIN)).collect();
        // Half a turn of joint 6 is the same pose for us and another one for the witness.
        legal.dedup_by(|a, b| difference(*a, *b) < 0.001);
        assert!(legal.len() <= 1, "{angles:?}: {legal:?}");
    }
}
