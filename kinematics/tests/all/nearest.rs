//! The nearest point within reach: against all poses of a fine grid, in `f32`, and at special points.

use fastrand::Rng;
use kinematics::limits::check_arm;
use kinematics::nearest::{nearest_tip, nearest_wrist};
use kinematics::{Float, Vector, forward, ik5, ik6};

const POINTS: usize = 300;

/// Positions of the wrist in the plane of the arm, on a grid of one degree.
fn reach() -> Vec<(f64, f64)> {
    let elbows = (0..=180).flat_map(|t2| (0..=180).map(move |t3| (f64::from(t2), f64::from(t3))));
    let poses =
        elbows.map(|(t2, t3)| [0.0, t2, t3, 90.0, 90.0, 90.0]).filter(|&pose| check_arm(pose).is_ok());
    poses.map(|pose| forward(pose).arm.wrist).map(|wrist| (wrist.x, wrist.z)).collect()
}

/// The distance from a point to the nearest of the grid, with joint 1 at each whole degree and in the plane of the point.
fn distance_to_grid(reach: &[(f64, f64)], point: Vector<f64>) -> f64 {
    let own = point.y.atan2(point.x).to_degrees();
    let headings = (0..=180).map(f64::from).chain([own, own + 180.0]).filter(|t1| (0.0..=180.0).contains(t1));
    let squares = headings.flat_map(|t1| {
        let (sine, cosine) = t1.to_radians().sin_cos();
        let (along, across) = (point.x * cosine + point.y * sine, point.y * cosine - point.x * sine);
        reach.iter().map(move |(radius, height)| {
            (along - radius).powi(2) + (point.z - height).powi(2) + across.powi(2)
        })
    });
    squares.fold(f64::MAX, f64::min).sqrt()
}

/// Random points in a box round the arm.
fn points(seed: u64) -> impl Iterator<Item = Vector<f64>> {
    println!("seed {seed}");
    let mut random = Rng::with_seed(seed);
    std::iter::repeat_with(move || {
        let mut within = |least: f64, most: f64| least + random.f64() * (most - least);
        Vector::new(within(-450.0, 450.0), within(-250.0, 450.0), within(-300.0, 500.0))
    })
}

#[test]
fn no_pose_of_the_arm_is_nearer() {
    let reach = reach();
    for point in points(6).take(POINTS) {
        let nearest = nearest_wrist(point).expect("a finite point");
        assert!(ik5(nearest).is_ok(), "{point:?}: {nearest:?}");
        let (ours, grid) = ((nearest - point).length(), distance_to_grid(&reach, point));
        // The grid has a pose within 5 mm of each position within reach.
        assert!(ours < grid + 1e-6 && grid < ours + 5.0, "{point:?}: {ours} mm, by the grid {grid} mm");
    }
}

#[test]
fn the_nearest_point_is_within_reach_in_f32_too() {
    for point in points(7).take(100 * POINTS) {
        let short = Vector::new(f32::of(point.x), f32::of(point.y), f32::of(point.z));
        let nearest = nearest_wrist(short).expect("a finite point");
        assert!(ik5(nearest).is_ok(), "{point:?}: {nearest:?}");
        let (ours, exact) = ((nearest - short).length(), (nearest_wrist(point).unwrap() - point).length());
        assert!((f64::from(ours) - exact).abs() < 0.01, "{point:?}: {ours} mm, {exact} mm");
    }
}

#[test]
fn a_point_within_reach_is_its_own_nearest() {
    let point = Vector::new(100.0, 200.0, 150.0);
    assert_eq!(nearest_wrist(point), Some(point));
}

#[test]
fn a_point_too_far_ahead_is_drawn_back_to_the_shoulder() {
    let nearest = nearest_wrist(Vector::new(0.0, 400.0, 74.5)).expect("a finite point");
    let wanted = Vector::new(0.0, 29.35 + 318.473, 74.5);
    assert!((nearest - wanted).length() < 0.001, "{nearest:?}");
}

#[test]
fn beside_the_base_axis_there_is_a_heading() {
    let nearest = nearest_wrist(Vector::new(0.0, 0.0, 300.0)).expect("a finite point");
    assert_eq!(nearest, Vector::new(0.002, 0.0, 300.0));
}

#[test]
fn the_tool_keeps_its_direction() {
    let (tip, down) = (Vector::new(500.0, 185.0, 50.0), Vector::new(0.0, 0.0, -2.0));
    let nearest = nearest_tip(tip, down).expect("the hand bends down there");
    assert!(ik6(nearest, down).is_ok());
    assert!((nearest - tip).length() < 220.0, "{nearest:?}");
    assert_eq!(
        nearest_tip(tip, Vector::new(0.0, 0.0, 1.0)).map(|_| ()),
        None,
        "the hand cannot bend up there"
    );
    assert_eq!(nearest_tip(tip, Vector::new(0.0, 0.0, 0.0)), None);
    assert_eq!(nearest_tip(Vector::new(f64::NAN, 0.0, 0.0), down), None);
}
