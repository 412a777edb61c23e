//! Which angles the arm can take: each joint, the parallelogram of joints 2 and 3, and the claw.
//!
//! An angle at a limit is legal. Because of rounding, a solution may be beyond a limit by up to [`TOLERANCE`].

use crate::float::Float;
use crate::geometry::{CLAW_MAX, JOINT_MAX, LEVEL_FOREARM, LINKAGE_MAX, LINKAGE_MIN};

/// How far an angle may be beyond a limit because of rounding, in degrees. At the arm's full length, a turn by this angle
/// moves the tip by 0.003 mm; one count of a servo is more than 0.2 degrees.
pub const TOLERANCE: f64 = 0.0005;

/// A limit that angles break. The checks return the first one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitBroken {
    /// The joint of this number, 1 to 6, is outside 0 to 180 degrees.
    Joint(u8),
    /// Joints 2 and 3 together: [`linkage`] is outside 19 to 161 degrees.
    Linkage,
    /// Joint 7 is outside 0 to 84 degrees.
    Claw,
}

/// The angle that the parallelogram limits: the angle of the rear arm above the line of the forearm, in degrees, from
/// the angles of joints 2 and 3.
#[must_use]
pub fn linkage<F: Float>(t2: F, t3: F) -> F {
    t3 - F::of(LEVEL_FOREARM) + t2
}

/// Checks the angles of joints 1 to 7, in degrees. With a suction cup, joint 7 has no such limit: use [`check_arm`].
///
/// # Errors
///
/// The first limit that is broken: joints in order, then the linkage, then the claw.
pub fn check<F: Float>([t1, t2, t3, t4, t5, t6, t7]: [F; 7]) -> Result<(), LimitBroken> {
    check_arm([t1, t2, t3, t4, t5, t6])?;
    if is_within(t7, 0.0, CLAW_MAX) { Ok(()) } else { Err(LimitBroken::Claw) }
}

/// Checks the angles of joints 1 to 6, in degrees.
///
/// # Errors
///
/// The first limit that is broken: joints in order, then the linkage.
pub fn check_arm<F: Float>(angles: [F; 6]) -> Result<(), LimitBroken> {
    let is_broken = |(_, angle): &(u8, F)| !is_within(*angle, 0.0, JOINT_MAX);
    if let Some((joint, _)) = (1..).zip(angles).find(is_broken) {
        return Err(LimitBroken::Joint(joint));
    }
    let [_, t2, t3, ..] = angles;
    if is_within(linkage(t2, t3), LINKAGE_MIN, LINKAGE_MAX) { Ok(()) } else { Err(LimitBroken::Linkage) }
}

/// Is an angle within these limits, or beyond one by no more than rounding? NaN is not.
pub(crate) fn is_within<F: Float>(degrees: F, least: f64, most: f64) -> bool {
    degrees >= F::of(least - TOLERANCE) && degrees <= F::of(most + TOLERANCE)
}

/// An angle of a joint, with rounding beyond a limit removed. `None` outside 0 to 180 degrees.
pub(crate) fn joint_angle<F: Float>(degrees: F) -> Option<F> {
    let (least, most) = (F::of(0.0), F::of(JOINT_MAX));
    let bounded = if degrees > most { most } else { degrees.larger(least) };
    is_within(degrees, 0.0, JOINT_MAX).then_some(bounded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_joint_ends_at_0_and_180() {
        for joint in 1..=6_u8 {
            for (angle, is_legal) in
                [(0.0, true), (180.0, true), (-0.001, false), (180.001, false), (f64::NAN, false)]
            {
                let mut angles = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0];
                angles[usize::from(joint) - 1] = angle;
                // With the other joint at this angle, joint 2 or 3 at an end does not break the linkage.
                let other = if angle > 90.0 { 20.0 } else { 100.0 };
                match joint {
                    2 => angles[2] = other,
                    3 => angles[1] = other,
                    _ => {}
                }
                let wanted = if is_legal { Ok(()) } else { Err(LimitBroken::Joint(joint)) };
                assert_eq!(check_arm(angles), wanted, "joint {joint} at {angle}");
            }
        }
    }

    #[test]
    fn the_parallelogram_limits_joints_2_and_3_together() {
        // From the range check of the maker's firmware.
        let verdict = |t2, t3| check_arm([90.0_f32, t2, t3, 90.0, 90.0, 90.0]);
        assert_eq!(verdict(60.0, 23.0), Err(LimitBroken::Linkage));
        assert_eq!(verdict(120.0, 120.0), Err(LimitBroken::Linkage));
        assert_eq!((verdict(160.0, 65.0), verdict(20.0, 65.0)), (Ok(()), Ok(())));
        assert_eq!((verdict(60.0, 24.0), verdict(161.0, 65.0)), (Ok(()), Ok(())), "the limits themselves");
    }

    #[test]
    fn the_claw_ends_where_its_servo_does() {
        let verdict = |t7| check([90.0, 90.0, 65.0, 90.0, 90.0, 90.0, t7]);
        assert_eq!((verdict(0.0), verdict(84.0)), (Ok(()), Ok(())));
        assert_eq!((verdict(-1.0), verdict(85.0)), (Err(LimitBroken::Claw), Err(LimitBroken::Claw)));
        assert_eq!(
            check([90.0, 20.0, 30.0, 90.0, 90.0, 90.0, 85.0]),
            Err(LimitBroken::Linkage),
            "comes first"
        );
    }

    #[test]
    fn rounding_beyond_a_limit_is_removed() {
        assert_eq!(joint_angle(-0.0004), Some(0.0));
        assert_eq!(joint_angle(180.0004_f32), Some(180.0));
        assert_eq!(joint_angle(12.5), Some(12.5));
        assert_eq!((joint_angle(-0.0006), joint_angle(180.0006), joint_angle(f32::NAN)), (None, None, None));
    }
}
