//! The angle of a joint from the position of its servo, finer than a count.

use motion_core::calibration::angle_from_counts;
use protocol_core::registers::Joint;

use crate::servo::units::COUNT;

/// For either kind of servo, the angle of this many counts is a whole number of thousandths of a degree.
const SPAN: u16 = 850;

/// The angle of a joint in thousandths of a degree, at a servo position in millionths of a count.
pub(crate) fn angle(joint: Joint, position: i64) -> i64 {
    let (first, last) = ends(joint);
    let span = i64::from(SPAN) * COUNT;
    first + ((last - first) * position + span / 2).div_euclid(span)
}

/// Do more counts mean a smaller angle?
pub(crate) fn is_reversed(joint: Joint) -> bool {
    let (first, last) = ends(joint);
    last < first
}

/// The angles at 0 and at [`SPAN`] counts, in thousandths of a degree.
fn ends(joint: Joint) -> (i64, i64) {
    let angle = |counts| i64::from(angle_from_counts(joint, counts, 0).0) / 1_000;
    (angle(0), angle(SPAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_counts_have_the_angles_of_the_calibration() {
        for joint in Joint::ALL {
            for counts in 0..=1_023 {
                let wanted = angle_from_counts(joint, counts, 0).0 / 1_000;
                let is = angle(joint, i64::from(counts) * COUNT);
                assert!((is - i64::from(wanted)).abs() <= 1, "{joint:?} at {counts}: {is}, not {wanted}");
            }
        }
    }

    #[test]
    fn a_tenth_of_a_count_changes_the_angle() {
        let joint = Joint::ALL[0];
        assert_eq!(angle(joint, 511 * COUNT + COUNT / 10) - angle(joint, 511 * COUNT), 21);
        assert_eq!(Joint::ALL.map(is_reversed), [false, true, true, true, true, true, false]);
    }
}
