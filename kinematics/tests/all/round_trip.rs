//! A million random legal poses are each found again from their positions, in `f32` and in `f64`.

use crate::common::legal_poses;
use kinematics::limits::check_arm;
use kinematics::{Float, Frames, Vector, forward, ik5, ik6, ik7};

const POSES: usize = 1_000_000;
/// The most that positions may differ, in mm.
const ALLOWED: f64 = 0.01;

fn exact<F: Float + Into<f64>>(vector: Vector<F>) -> Vector<f64> {
    Vector::new(vector.x.into(), vector.y.into(), vector.z.into())
}

fn distance(a: Vector<f64>, b: Vector<f64>) -> f64 {
    (a - b).length()
}

/// The distances between old and new wrist, tip and edge of the disc, in mm. The two edges may have changed places.
fn distances(was: &Frames<f64>, is: &Frames<f64>) -> [f64; 3] {
    let edge = distance(was.hand.disc_edge, is.hand.disc_edge);
    let opposite = distance(was.hand.disc_edge, is.hand.opposite_edge);
    [distance(was.arm.wrist, is.arm.wrist), distance(was.hand.tip, is.hand.tip), edge.min(opposite)]
}

/// Converts angles to positions and back to angles, all in `F`. Returns the distances between the poses, computed in `f64`.
fn round_trip<F: Float + Into<f64>>(pose: [f64; 6]) -> [f64; 3] {
    let pose = pose.map(F::of);
    let Frames { arm, hand } = forward(pose);
    let found = ik7(hand.tip, hand.tool, hand.disc).unwrap_or_else(|why| panic!("{pose:?}: {why:?}"));
    assert_eq!(check_arm(found), Ok(()), "{pose:?}");
    assert_eq!(ik6(hand.tip, hand.tool).expect("ik7 solves it"), found[..5], "{pose:?}");
    let [t1, t2, t3] = ik5(arm.wrist).unwrap_or_else(|why| panic!("{pose:?}: {why:?}"));
    let wrist = forward([t1, t2, t3, F::of(90.0), F::of(90.0), F::of(90.0)]).arm.wrist;
    assert!(distance(exact(wrist), exact(arm.wrist)) < ALLOWED, "{pose:?}");
    distances(&forward(pose.map(Into::into)), &forward(found.map(Into::into)))
}

fn worst<F: Float + Into<f64>>(poses: impl Iterator<Item = [f64; 6]>) -> f64 {
    let mut worst = [0.0_f64; 3];
    for pose in poses {
        let distances = round_trip::<F>(pose);
        assert!(distances.iter().all(|&distance| distance < ALLOWED), "{pose:?}: {distances:?} mm");
        worst = std::array::from_fn(|part| worst[part].max(distances[part]));
    }
    println!("worst of wrist, tip, edge: {worst:?} mm");
    worst.into_iter().fold(0.0, f64::max)
}

#[test]
fn a_million_legal_poses_in_f32() {
    worst::<f32>(legal_poses(1).take(POSES));
}

#[test]
fn a_million_legal_poses_in_f64() {
    assert!(worst::<f64>(legal_poses(2).take(POSES)) < 1e-9, "f64 is better than that");
}
