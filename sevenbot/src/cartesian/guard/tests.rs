use kinematics::geometry::{BASE_HEIGHT, BASE_RADIUS};
use kinematics::limits::check_arm;
use kinematics::{Frames, forward};

use super::super::{DOWN, TipRefusal, TipTarget, Vector};
use super::*;
use crate::units::{MoveTime, Speed};

/// Random numbers of a linear congruential generator (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from(self.0 >> 32).expect("32 bits")
    }

    /// A speed of 1 to 64 steps.
    fn speed(&mut self) -> Speed {
        let steps = u8::try_from(self.next() >> 26).expect("6 bits");
        Speed::from_steps(1 + steps).expect("a speed")
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        let share = f64::from(self.next()) / f64::from(u32::MAX);
        low + (high - low) * share
    }

    /// A pose within the limits, with the tip lower than z = 60 mm.
    fn pose(&mut self) -> [f64; 5] {
        loop {
            let pose = [
                self.within(0.0, 180.0),
                self.within(0.0, 180.0),
                self.within(60.0, 180.0),
                self.within(0.0, 180.0),
                self.within(0.0, 180.0),
            ];
            let [t1, t2, t3, t4, t5] = pose;
            let all = [t1, t2, t3, t4, t5, 90.0];
            if check_arm(all).is_ok() && forward(all).hand.tip.z < 60.0 {
                return pose;
            }
        }
    }
}

/// Points of the arm, computed without the guard's code: elbow, wrist, tip, and 24 points of the disc's edge.
fn points([t1, t2, t3, t4, t5]: [f64; 5]) -> Vec<Vector> {
    let frames = |t6: f64| forward([t1, t2, t3, t4, t5, t6]);
    let Frames { arm, hand } = frames(90.0);
    let edge = (0..12).flat_map(|part| {
        let hand = frames(f64::from(part) * 15.0).hand;
        [hand.disc_edge, hand.opposite_edge]
    });
    [arm.elbow, arm.wrist, hand.tip].into_iter().chain(edge).collect()
}

/// Is the point in the base itself, without the margin?
fn is_in_base(point: Vector) -> bool {
    point.z < 0.0 && point.z > -BASE_HEIGHT && point.x.hypot(point.y) < BASE_RADIUS
}

#[test]
fn the_poses_of_the_documents_are_allowed() {
    let guard = Guard::default();
    let poses = [
        [90.0, 90.0, 65.0, 90.0, 90.0],
        [120.0, 90.0, 65.0, 90.0, 90.0],
        [105.0, 88.0, 110.0, 90.0, 135.0],
        [150.0, 60.0, 90.0, 120.0, 60.0],
        [90.0, 115.0, 65.0, 90.0, 90.0],
        [130.0, 100.0, 80.0, 130.0, 130.0],
        [50.0, 80.0, 50.0, 50.0, 50.0],
    ];
    for pose in poses {
        assert_eq!(guard.check_pose(pose), Ok(()), "{pose:?}");
        for other in poses {
            assert_eq!(guard.check_path(&JointPath::together(pose, other)), Ok(()), "{pose:?} to {other:?}");
        }
    }
    // Examples of the maker and of the help texts.
    for [x, y, z] in [
        [0.0, 185.0, 50.0],
        [-50.0, 185.0, 50.0],
        [60.0, 200.0, 50.0],
        [0.0, 250.0, 100.0],
        [-40.0, 130.0, 35.0],
        [-140.0, 105.0, 15.0],
        [100.0, 200.0, 50.0],
    ] {
        let target = TipTarget::guarded(Vector::new(x, y, z), DOWN, Some(&guard));
        assert!(target.is_ok(), "{x} {y} {z}: {target:?}");
    }
}

#[test]
fn a_point_below_the_foot_is_refused_with_the_point_above_it() {
    let tip = Vector::new(0.0, 185.0, -100.0);
    assert!(TipTarget::of(tip, DOWN).is_ok(), "it is within reach");
    let refusal = TipTarget::guarded(tip, DOWN, Some(&Guard::default())).expect_err("below the table");
    assert_eq!(
        refusal.to_string(),
        "0 185 -100 mm with the tool straight down (0 0 -1) is not allowed: the tip would be 40.0 mm below the table at \
         z = -60 mm; the nearest allowed point is 0 185 -60 mm, 40.0 mm away"
    );
    assert!(TipTarget::guarded(tip, DOWN, Some(&Guard::above(-120.0))).is_ok(), "the arm stands on a block");
}

#[test]
fn a_point_in_the_base_is_sent_to_one_outside() {
    let refusal = TipTarget::guarded(Vector::new(0.0, 0.0, 0.0), DOWN, Some(&Guard::default()));
    let Err(TipRefusal::Unreachable(refusal)) = refusal else { panic!("{refusal:?}") };
    let nearest = refusal.nearest.expect("a point");
    assert!(points_at(nearest).into_iter().all(|point| !is_in_base(point)), "{nearest:?}");
    assert!(TipTarget::guarded(nearest, DOWN, Some(&Guard::default())).is_ok(), "{nearest:?}");
    let unguarded = TipTarget::of(Vector::new(0.0, 0.0, 0.0), DOWN).expect_err("too near").nearest;
    assert!(
        points_at(unguarded.expect("a point")).into_iter().any(is_in_base),
        "without a guard it is inside"
    );
}

fn points_at(tip: Vector) -> Vec<Vector> {
    points(TipTarget::of(tip, DOWN).expect("within reach").angles)
}

#[test]
fn what_is_recommended_is_allowed() {
    let mut random = Random(7);
    for table in [-60.0, 0.0, 40.0] {
        let guard = Guard::above(table);
        for _ in 0..40 {
            let tip = Vector::new(
                random.within(-350.0, 350.0),
                random.within(-150.0, 350.0),
                random.within(-200.0, 100.0),
            );
            let Err(refusal) = TipTarget::guarded(tip, DOWN, Some(&guard)) else { continue };
            let nearest = match &refusal {
                TipRefusal::Unreachable(refusal) => refusal.nearest,
                TipRefusal::Guarded(refusal) => refusal.nearest,
            };
            let nearest = nearest.unwrap_or_else(|| panic!("{tip:?}: nothing"));
            let target = TipTarget::guarded(nearest, DOWN, Some(&guard));
            let target = target.unwrap_or_else(|why| panic!("{tip:?}: {why}"));
            assert_eq!(guard.check_pose(target.degrees.map(f64::from)), Ok(()), "whole degrees, {tip:?}");
            if let Some(tool) = refusal.other_tool() {
                assert!(TipTarget::guarded(tip, tool, Some(&guard)).is_ok(), "{tip:?} {tool:?}");
            }
        }
    }
}

#[test]
fn an_allowed_way_never_takes_a_point_below_the_table_or_into_the_base() {
    let mut random = Random(23);
    let (mut allowed, mut refused) = (0, 0);
    while allowed < 150 {
        let guard = if allowed % 2 == 0 { Guard::default() } else { Guard::above(30.0) };
        let (from, to) = (random.pose(), random.pose());
        if guard.check_pose(from).is_err() || guard.check_pose(to).is_err() {
            continue;
        }
        let speeds = [(); 5].map(|()| random.speed());
        let path = JointPath::at_pace(from, to, speeds, [MoveTime::NONE; 5]);
        if guard.check_path(&path).is_err() {
            refused += 1;
            continue;
        }
        allowed += 1;
        // Ten times as many poses as the guard checks.
        let mut before: Option<[f64; 5]> = None;
        for (_, pose) in path.poses() {
            for part in 0..10 {
                let last = before.unwrap_or(pose);
                let between: [f64; 5] = std::array::from_fn(|joint| {
                    last[joint] + (pose[joint] - last[joint]) * f64::from(part) / 10.0
                });
                for point in points(between) {
                    assert!(point.z > guard.table_mm() - ROUNDING_MM - 0.01, "{from:?} {to:?}: {point:?}");
                    assert!(!is_in_base(point), "{from:?} {to:?}: {point:?}");
                }
            }
            before = Some(pose);
        }
    }
    assert!(refused > 20, "some ways meet an obstacle: {refused}");
}

#[test]
fn a_way_may_leave_an_obstacle_but_go_no_deeper() {
    let guard = Guard::default();
    let at = |z: f64| TipTarget::of(Vector::new(0.0, 185.0, z), DOWN).expect("within reach").angles;
    assert_eq!(guard.check_path(&JointPath::together(at(-90.0), at(0.0))), Ok(()));
    assert_eq!(guard.check_path(&JointPath::together(at(-90.0), at(-80.0))), Ok(()));
    let deeper = guard.check_path(&JointPath::together(at(-90.0), at(-100.0))).expect_err("deeper");
    assert_eq!(deeper.share, 1.0);
    assert!(
        deeper.to_string().starts_with("at its end the tip would be 40.0 mm below the table"),
        "{deeper}"
    );
}

#[test]
fn a_recording_is_checked_between_its_moments() {
    let [low, high] =
        [80.0, 0.0].map(|z| TipTarget::of(Vector::new(0.0, 185.0, z), DOWN).expect("within reach"));
    let line = |time: &str, target: &TipTarget| {
        let degrees = target.degrees.map(|degrees| degrees.to_string()).join(" ");
        format!("{time} {degrees} 90 80 0\n")
    };
    let text = format!("7bot-recording 1\n{}{}{}", line("1", &low), line("2.5", &high), line("3", &low));
    let recording = Recording::parse(&text).expect("a recording");
    assert_eq!(Guard::default().check_recording(&recording), Ok(()));
    let breach = Guard::above(40.0).check_recording(&recording).expect_err("below 40");
    assert!(breach.to_string().starts_with("at 2.50 s the tip would be"), "{breach}");
}

#[test]
fn a_way_below_the_table_is_told_with_its_deepest_place() {
    // Both ends are 15 mm above the table, and joint 2 leans forward before joint 3 lifts the forearm.
    let guard = Guard::above(0.0);
    let at = |y: f64| TipTarget::of(Vector::new(0.0, y, 15.0), DOWN).expect("within reach").angles;
    let mut speeds = [Speed::from_steps(10).expect("a speed"); 5];
    speeds[1] = Speed::MAXIMUM;
    let path = JointPath::at_pace(at(150.0), at(250.0), speeds, [MoveTime::NONE; 5]);
    let breach = guard.check_path(&path).expect_err("it dips");
    assert!(breach.share > 0.0 && breach.share < 1.0, "{breach:?}");
    assert!(breach.to_string().contains("% of the way the tip would be"), "{breach}");
}
