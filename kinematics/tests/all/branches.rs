//! Poses that a solution with one branch misses, poses at the ends of the joints, and the reasons of refusals.

use kinematics::limits::{check_arm, linkage};
use kinematics::{Float, NoSolution, Vector, forward, ik5, ik6, ik7};

const DOWN: Vector<f64> = Vector::new(0.0, 0.0, -1.0);

/// Solves for a wrist, and returns the angles after a check that they bring it there.
fn wrist(x: f64, y: f64, z: f64) -> [f64; 3] {
    let asked = Vector::new(x, y, z);
    let angles = ik5(asked).expect("within reach");
    let [t1, t2, t3] = angles;
    let pose = [t1, t2, t3, 90.0, 90.0, 90.0];
    assert_eq!(check_arm(pose), Ok(()));
    assert!((forward(pose).arm.wrist - asked).length() < 1e-9);
    angles
}

#[test]
fn a_wrist_above_the_base_is_behind_the_shoulder() {
    let [t1, ..] = wrist(0.0, 20.0, 330.0);
    assert_eq!(t1, 90.0);
}

#[test]
fn a_wrist_behind_the_base_axis_is_reached_backwards() {
    let [t1, t2, _] = wrist(-10.0, -10.0, 300.0);
    assert!((t1 - 45.0).abs() < 1e-9, "the arm heads to the right in front, away from the wrist: {t1}");
    assert!(t2 > 90.0);
    assert_eq!(ik5(Vector::new(0.0, -150.0, 150.0)), Err(NoSolution::Joint(1)));
}

#[test]
fn a_wrist_to_the_left_turns_joint_1_to_180_whatever_the_sign_of_zero() {
    for y in [0.0_f64, -0.0, 1e-9, -1e-9] {
        assert_eq!(ik5(Vector::new(-200.0, y, 120.0)).map(|[t1, ..]| t1.round()), Ok(180.0), "y {y}");
        assert_eq!(ik5(Vector::new(200.0, y, 120.0)).map(|[t1, ..]| t1.round()), Ok(0.0), "y {y}");
    }
}

#[test]
fn a_wrist_that_two_headings_reach_is_faced() {
    assert_eq!(wrist(10.0, 0.0, 300.0)[0], 0.0);
    assert_eq!(wrist(-10.0, 0.0, 300.0)[0], 180.0);
}

#[test]
fn a_tool_in_line_with_the_forearm_leaves_the_roll_at_90() {
    for t3 in [40.0, 65.0, 100.0, 123.4] {
        let hand = forward([80.0, 90.0, t3, 10.0, 90.0, 30.0]).hand;
        let [.., t4, t5] = ik6(hand.tip, hand.tool).expect("within reach");
        assert!(t4 == 90.0 && (t5 - 90.0).abs() < 1e-9, "{t4} {t5}");
    }
}

#[test]
fn a_hand_bent_to_the_side_has_joint_5_below_90() {
    for (t4, t5, wanted) in
        [(0.0, 60.0, (0.0, 60.0)), (180.0, 120.0, (0.0, 60.0)), (180.0, 60.0, (180.0, 60.0))]
    {
        let hand = forward([80.0, 90.0, 65.0, t4, t5, 30.0]).hand;
        let [.., t4, t5] = ik6(hand.tip, hand.tool).expect("within reach");
        assert!((t4 - wanted.0).abs() < 1e-9 && (t5 - wanted.1).abs() < 1e-9, "{t4} {t5}");
    }
}

/// All legal poses in whole degrees in which joint 2, joint 3 or the linkage is at an end, and joints 1, 4, 5 and 6 are at 0, 90
/// or 180 degrees.
fn poses_at_limits() -> impl Iterator<Item = [f64; 6]> {
    const ENDS: [f64; 3] = [0.0, 90.0, 180.0];
    let elbows = (0..=180).flat_map(|t2| (0..=180).map(move |t3| (f64::from(t2), f64::from(t3))));
    let at_limits = elbows.filter(|&(t2, t3)| {
        let is_end = |angle: f64| angle == 0.0 || angle == 180.0;
        let linkage = linkage(t2, t3);
        is_end(t2) && (19.0..=161.0).contains(&linkage)
            || is_end(t3) && (19.0..=161.0).contains(&linkage)
            || linkage == 19.0
            || linkage == 161.0
    });
    at_limits.flat_map(|(t2, t3)| {
        (0..81).map(move |rest: usize| {
            let end = |place: usize| ENDS[rest / 3_usize.pow(u32::try_from(place).unwrap()) % 3];
            [end(0), t2, t3, end(1), end(2), end(3)]
        })
    })
}

fn solves_all_at_limits<F: Float + Into<f64>>() {
    let mut poses = 0;
    for pose in poses_at_limits() {
        let hand = forward(pose.map(F::of)).hand;
        let found = ik7(hand.tip, hand.tool, hand.disc).unwrap_or_else(|why| panic!("{pose:?}: {why:?}"));
        assert_eq!(check_arm(found), Ok(()), "{pose:?}");
        let (was, is) = (forward(pose).hand, forward(found.map(Into::into)).hand);
        let edge = (was.disc_edge - is.disc_edge).length().min((was.disc_edge - is.opposite_edge).length());
        assert!((was.tip - is.tip).length() < 0.01 && edge < 0.01, "{pose:?}: {found:?}");
        poses += 1;
    }
    assert!(poses > 40_000, "{poses}");
}

#[test]
fn rounding_refuses_no_pose_at_a_limit_in_f32() {
    solves_all_at_limits::<f32>();
}

#[test]
fn rounding_refuses_no_pose_at_a_limit_in_f64() {
    solves_all_at_limits::<f64>();
}

#[test]
fn a_hundredth_of_a_degree_beyond_a_limit_is_refused() {
    let beyond = [
        ([90.0, -0.01, 90.0], NoSolution::Joint(2)),
        ([90.0, 180.01, 40.0], NoSolution::Joint(2)),
        ([90.0, 100.0, -0.01], NoSolution::Joint(3)),
        ([90.0, 40.0, 180.01], NoSolution::Joint(3)),
        ([90.0, 40.0, 43.99], NoSolution::TooFar),
        ([90.0, 100.0, 126.01], NoSolution::TooNear),
        ([-0.01, 90.0, 65.0], NoSolution::Joint(1)),
        ([180.01, 90.0, 65.0], NoSolution::Joint(1)),
    ];
    for ([t1, t2, t3], why) in beyond {
        let pose = [t1, t2, t3, 90.0, 90.0, 90.0];
        assert_eq!(ik5(forward(pose).arm.wrist), Err(why), "{pose:?}");
        assert_eq!(ik5(forward(pose.map(f32::of)).arm.wrist), Err(why), "{pose:?} in f32");
    }
    let bent = forward([90.0, 90.0, 65.0, 70.0, -0.01, 90.0]).hand;
    assert_eq!(ik6(bent.tip, bent.tool), Err(NoSolution::ToolDirection));
}

#[test]
fn the_heading_that_gets_further_gives_the_reason() {
    let behind = Vector::new(-10.0, -10.0, 300.0);
    assert!(ik5(behind).is_ok());
    assert_eq!(ik6(behind + DOWN * 22.46, DOWN), Err(NoSolution::ToolDirection));
}

#[test]
fn what_has_no_direction_is_told() {
    let (tip, zero) = (Vector::new(0.0, 250.0, 100.0), Vector::new(0.0, 0.0, 0.0));
    assert_eq!(ik6(tip, zero), Err(NoSolution::NoToolDirection));
    assert_eq!(ik7(tip, DOWN, zero), Err(NoSolution::NoDiscDirection));
    assert_eq!(ik7(tip, DOWN, DOWN * -3.0), Err(NoSolution::NoDiscDirection), "parallel to the tool");
    assert_eq!(ik5(zero), Err(NoSolution::NoHeading));
    for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let (tip, down, odd) =
            (Vector::new(0.0, 250.0, 100.0), Vector::new(0.0, 0.0, -1.0), Vector::new(1.0, odd, 1.0));
        assert_eq!(ik6(down * 22.46, down), Err(NoSolution::NoHeading));
        assert_eq!(ik5(odd), Err(NoSolution::NotFinite));
        assert_eq!(ik6(odd, down), Err(NoSolution::NotFinite));
        assert_eq!(ik6(tip, odd), Err(NoSolution::NotFinite));
        assert_eq!(ik7(tip, down, odd), Err(NoSolution::NotFinite));
    }
    assert_eq!(ik5(Vector::new(1e30_f32, -1e30, 1e30)), Err(NoSolution::TooFar), "its square is infinite");
}

#[test]
fn whole_numbers_that_are_nearly_parallel_have_a_plane() {
    let tip = Vector::new(0.0_f32, 250.0, 250.0);
    let (tool, disc) = (Vector::new(1.0, 127.0, 126.0), Vector::new(1.0, 126.0, 125.0));
    assert!(ik7(tip, tool, disc).is_ok());
    assert_eq!(ik7(tip, tool, tool), Err(NoSolution::NoDiscDirection));
}
