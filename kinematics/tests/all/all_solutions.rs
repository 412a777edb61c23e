//! All solutions of a position: both ends of joint 1, both ends of joint 4, positions with one solution, random poses.

use kinematics::limits::check_arm;
use kinematics::{NoSolution, Vector, forward, ik5, ik5_all, ik6, ik6_all};

/// The solutions for a tip. Checks that each of them brings the tip there and obeys the limits.
fn solutions(tip: Vector<f64>, tool: Vector<f64>) -> Vec<[f64; 5]> {
    let all = ik6_all(tip, tool).expect("within reach");
    assert_eq!(all[0], ik6(tip, tool).ok(), "the first is that of ik6");
    let found: Vec<_> = all.into_iter().flatten().collect();
    for &[t1, t2, t3, t4, t5] in &found {
        let pose = [t1, t2, t3, t4, t5, 90.0];
        let hand = forward(pose).hand;
        assert_eq!(check_arm(pose), Ok(()), "{pose:?}");
        assert!((hand.tip - tip).length() < 1e-9 && (hand.tool - tool).length() < 1e-9, "{pose:?}");
    }
    found
}

#[test]
fn a_wrist_to_the_left_has_joint_1_at_180_and_at_0() {
    for (x, first) in [(-10.0, 180.0_f64), (10.0, 0.0)] {
        for y in [0.0, -0.0] {
            let wrist = Vector::new(x, y, 300.0);
            let [faced, turned] = ik5_all(wrist).expect("within reach").map(|angles| angles.expect("both"));
            assert_eq!(Ok(faced), ik5(wrist));
            assert!((faced[0] - first).abs() < 1e-9 && (turned[0] - (180.0 - first)).abs() < 1e-9);
            for [t1, t2, t3] in [faced, turned] {
                assert!((forward([t1, t2, t3, 90.0, 90.0, 90.0]).arm.wrist - wrist).length() < 1e-9);
            }
        }
    }
}

#[test]
fn a_wrist_elsewhere_has_one_solution() {
    for wrist in [Vector::new(-10.0, 5.0, 300.0), Vector::new(-200.0, 0.0, 120.0)] {
        assert!(matches!(ik5_all(wrist), Ok([Some(_), None])), "{wrist:?}");
    }
    assert_eq!(ik5_all(Vector::new(0.0, 400.0, 0.0)), Err(NoSolution::TooFar));
}

#[test]
fn a_hand_that_bends_to_the_side_has_joint_4_at_both_ends() {
    let hand = forward([80.0, 90.0, 65.0, 0.0, 60.0, 30.0]).hand;
    let found = solutions(hand.tip, hand.tool);
    assert_eq!(found.len(), 2, "{found:?}");
    let rolls: Vec<_> = found.iter().map(|&[.., t4, t5]| (t4.round(), t5.round())).collect();
    assert_eq!(rolls, [(0.0, 60.0), (180.0, 120.0)]);
}

#[test]
fn both_ends_of_both_joints_are_four_solutions() {
    // The tool points along y, at right angles to both headings of a wrist with y = 0.
    let (tool, wrist) = (Vector::new(0.0, 1.0, 0.0), Vector::new(-10.0, 0.0, 300.0));
    let found = solutions(wrist + tool * 22.46, tool);
    let ends: Vec<_> = found.iter().map(|&[t1, .., t4, _]| (t1.round(), t4.round())).collect();
    assert_eq!(ends.len(), 4, "{found:?}");
    for end in [(180.0, 0.0), (180.0, 180.0), (0.0, 0.0), (0.0, 180.0)] {
        assert!(ends.contains(&end), "{ends:?}");
    }
}

#[test]
fn random_poses_are_among_the_solutions() {
    let mut random = fastrand::Rng::with_seed(7);
    let mut tried = 0;
    while tried < 20_000 {
        let pose = [(); 6].map(|()| f64::from(random.u8(0..=180)));
        if check_arm(pose).is_err() {
            continue;
        }
        tried += 1;
        let hand = forward(pose).hand;
        let found = solutions(hand.tip, hand.tool);
        let is_found = found.iter().any(|angles| {
            let [.., t4, t5] = *angles;
            let is_aligned = (t5 - 90.0).abs() < 1e-6;
            let same = angles.iter().zip(pose).take(3).all(|(angle, wanted)| (angle - wanted).abs() < 1e-6);
            same && (is_aligned || (t4 - pose[3]).abs() < 1e-6) && (t5 - pose[4]).abs() < 1e-6
        });
        assert!(is_found, "{pose:?}: {found:?}");
    }
}
