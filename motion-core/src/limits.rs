//! The limits of the linkage and the claw ([D25](protocol_core::decisions#d25)).
//!
//! This file does not know the register file or the bus.

use protocol_core::registers::map::limit;

use crate::calibration::MicroDegrees;

/// The smallest and the largest sum of the angles of joints 2 and 3, in millionths of a degree.
const LINKAGE_SUM: (i32, i32) =
    (limit::LINKAGE_SUM.0 as i32 * 1_000_000, limit::LINKAGE_SUM.1 as i32 * 1_000_000);
/// The largest angle of joint 7.
const CLAW_MAX: MicroDegrees = MicroDegrees::from_degrees(limit::CLAW_MAX);

/// Does the linkage allow these angles of joints 2 and 3?
#[must_use]
pub const fn linkage_allows(two: MicroDegrees, three: MicroDegrees) -> bool {
    let (min, max) = LINKAGE_SUM;
    let sum = two.0.saturating_add(three.0);
    min <= sum && sum <= max
}

/// Can the claw be at this angle of joint 7?
#[must_use]
pub const fn claw_allows(seven: MicroDegrees) -> bool {
    seven.0 <= CLAW_MAX.0
}

/// The set-points of joints 2 and 3 after a step. The part of a joint's step that would break the linkage is left
/// out: the joint waits. Outside the limits, only steps inwards are allowed.
#[must_use]
pub fn linkage_step(before: [MicroDegrees; 2], after: [MicroDegrees; 2]) -> [MicroDegrees; 2] {
    let (min, max) = LINKAGE_SUM;
    let [two, three] = after;
    let sum = two.0.saturating_add(three.0);
    let mut excess = if sum > max { sum - max } else { (sum - min).min(0) };
    let mut limited = |before: MicroDegrees, after: MicroDegrees| {
        let step = after.0 - before.0;
        // The part of the step that leaves the range. Without `clamp`, which contains a panic path.
        let outward = if excess > 0 { step.max(0).min(excess) } else { step.min(0).max(excess) };
        excess -= outward;
        MicroDegrees(after.0 - outward)
    };
    let [two_before, three_before] = before;
    [limited(two_before, two), limited(three_before, three)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees(pair: [i32; 2]) -> [MicroDegrees; 2] {
        pair.map(|degrees| MicroDegrees(degrees * 1_000_000))
    }

    fn step(before: [i32; 2], after: [i32; 2]) -> [i32; 2] {
        linkage_step(degrees(before), degrees(after)).map(|angle| angle.0 / 1_000_000)
    }

    #[test]
    fn d25_the_limits_are_those_of_the_linkage_and_the_claw() {
        let allows = |pair| {
            let [two, three] = degrees(pair);
            linkage_allows(two, three)
        };
        assert_eq!(
            [[0, 84], [0, 83], [180, 46], [180, 47], [90, 65]].map(allows),
            [true, false, true, false, true]
        );
        assert!(claw_allows(MicroDegrees(84_000_000)) && !claw_allows(MicroDegrees(84_000_001)));
    }

    #[test]
    fn d25_the_joint_that_would_break_the_linkage_waits() {
        assert_eq!(step([100, 120], [103, 122]), [103, 122], "225");
        assert_eq!(step([100, 125], [103, 123]), [103, 123], "226");
        assert_eq!(step([100, 126], [103, 125]), [101, 125], "joint 2 goes as far as joint 3 makes room");
        assert_eq!(step([100, 126], [99, 129]), [99, 127], "joint 3 likewise");
        assert_eq!(step([100, 126], [103, 129]), [100, 126], "nobody makes room");
        assert_eq!(step([100, 125], [102, 127]), [100, 126], "both use the room that there is");
        assert_eq!(step([20, 64], [17, 65]), [19, 65], "the lower limit");
        assert_eq!(step([20, 64], [17, 60]), [20, 64]);
    }

    #[test]
    fn d25_from_outside_a_step_goes_only_inwards() {
        assert_eq!(step([120, 120], [122, 118]), [120, 118], "joint 2 would go outwards");
        assert_eq!(step([120, 120], [118, 119]), [118, 119]);
        assert_eq!(step([120, 120], [123, 123]), [120, 120]);
        assert_eq!(step([30, 30], [28, 33]), [30, 33]);
    }
}
