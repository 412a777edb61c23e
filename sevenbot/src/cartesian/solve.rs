//! Computes the targets for a position of the tip, or says why there are none.

use kinematics::ik6;

use super::Vector;
use super::guard::Guard;
use super::refusal::{GuardedTip, TipRefusal, Unreachable};
use super::target::TipTarget;

impl TipTarget {
    /// The targets for a tip in millimetres, with the tool in a direction of any length.
    ///
    /// # Errors
    /// The position is out of reach: the reason, and the nearest point within reach.
    pub fn of(tip: Vector, tool: Vector) -> Result<Self, Unreachable> {
        let angles = ik6(tip, tool).map_err(|why| Unreachable::because(why, tip, tool, None))?;
        Ok(Self::near(angles, tip, tool.unit().unwrap_or(tool), None))
    }

    /// As [`TipTarget::of`], but refuses a position that the guard does not allow; `None`: no guard.
    ///
    /// # Errors
    /// The position is out of reach or not allowed: the reason, and the nearest point that is within reach and allowed.
    pub fn guarded(tip: Vector, tool: Vector, guard: Option<&Guard>) -> Result<Self, TipRefusal> {
        let unreachable = |why| TipRefusal::Unreachable(Unreachable::because(why, tip, tool, guard));
        let angles = ik6(tip, tool).map_err(unreachable)?;
        if let Some(guard) = guard {
            let refused = |breach| GuardedTip::because(breach, tip, tool, guard);
            let refused = |breach| TipRefusal::Guarded(Box::new(refused(breach)));
            guard.check_pose(angles).map_err(refused)?;
        }
        Ok(Self::near(angles, tip, tool.unit().unwrap_or(tool), guard))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DOWN, PointText};
    use super::*;
    use kinematics::forward;
    use kinematics::limits::check_arm;

    fn v(x: f64, y: f64, z: f64) -> Vector {
        Vector::new(x, y, z)
    }

    fn pose_of(target: &TipTarget) -> [f64; 6] {
        let [t1, t2, t3, t4, t5] = target.degrees.map(f64::from);
        [t1, t2, t3, t4, t5, 90.0]
    }

    #[test]
    fn the_makers_example_is_reached_to_a_millimetre() {
        let target = TipTarget::of(v(-50.0, 185.0, 50.0), DOWN).expect("within reach");
        let exact = [105.124, 88.229, 109.746, 90.0, 135.254];
        assert!(target.angles.iter().zip(exact).all(|(angle, exact)| (angle - exact).abs() < 0.001));
        assert_eq!(target.degrees, [105, 88, 110, 90, 135]);
        assert!(target.miss_mm < 1.0 && target.tilt_degrees < 1.0, "{target:?}");
        let fine = target.in_hundredths(v(-50.0, 185.0, 50.0), DOWN).expect("within the limits");
        assert_eq!(fine.angles[0].hundredths(), 10_512);
        assert!(fine.miss_mm < 0.05 && fine.tilt_degrees < 0.02, "{fine:?}");
    }

    #[test]
    fn whole_degrees_keep_the_limits_and_miss_by_little() {
        let mut worst: f64 = 0.0;
        for (t2, t3) in (0..=180_u8).flat_map(|t2| (0..=180_u8).map(move |t3| (t2, t3))) {
            for part in [0.0, 0.5] {
                let pose = [77.3, f64::from(t2), f64::from(t3) + part, 80.0, 100.4, 90.0];
                if check_arm(pose).is_err() {
                    continue;
                }
                let hand = forward(pose).hand;
                let target = TipTarget::of(hand.tip, hand.tool).expect("a legal pose");
                assert_eq!(check_arm(pose_of(&target)), Ok(()), "{pose:?}");
                worst = worst.max(target.miss_mm);
            }
        }
        assert!(worst < 3.0, "{worst} mm");
    }

    #[test]
    fn what_is_out_of_reach_says_how_far_and_what_is_within() {
        let refused = TipTarget::of(v(0.0, 500.0, 50.0), DOWN).expect_err("too far");
        let words = refused.to_string();
        assert!(
            words.starts_with(
                "0 500 50 mm with the tool straight down (0 0 -1) is out of reach: it is too far"
            )
        );
        let nearest = refused.nearest.expect("one");
        assert!(words.ends_with(&format!(
            "the nearest point within reach is {} mm, {:.1} mm away",
            PointText(nearest),
            (nearest - refused.tip).length()
        )));
        assert!(TipTarget::of(nearest, DOWN).is_ok(), "the point that is told can be asked for");
    }

    #[test]
    fn a_direction_that_works_is_found_where_the_one_asked_for_does_not() {
        let refused = TipTarget::of(v(0.0, 250.0, 280.0), DOWN).expect_err("too high for that");
        let other = refused.other_tool.expect("forward or so");
        assert!(TipTarget::of(refused.tip, other).is_ok());
        let refused = TipTarget::of(v(0.0, 900.0, 0.0), DOWN).expect_err("too far for all");
        assert_eq!(refused.other_tool, None);
    }

    #[test]
    fn numbers_that_are_no_position_are_told() {
        let words = |tip, tool| TipTarget::of(tip, tool).expect_err("none").to_string();
        assert!(words(v(0.0, 200.0, 50.0), v(0.0, 0.0, 0.0)).contains("points nowhere"));
        assert!(words(v(f64::NAN, 200.0, 50.0), DOWN).contains("finite"));
    }
}
