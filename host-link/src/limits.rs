//! The targets that hold an arm, within its limits ([D25](protocol_core::decisions#d25)).
//!
//! An arm refuses a whole frame of targets if one is against a limit. A measured position may be against a limit, because
//! a moving joint is some degrees off its set-point. If a stop wrote such positions as targets, the arm would refuse the
//! frame and stop no joint.

use protocol_core::registers::JOINTS;
use protocol_core::registers::map::limit;

/// Hundredths of a degree in a degree.
const DEGREE: u16 = 100;

/// Brings the targets that hold an arm within its limits. All are in hundredths of a degree: `present` holds the
/// targets of the arm, and `written` the targets that are to be written. `limits` is register 188.
///
/// If the targets of joints 2 and 3 break the limit of the linkage, joint 2 gets a target further inwards, at the limit, if it
/// moves inwards or joint 3 gets no target. Otherwise joint 3 gets one. Targets against a limit that equal those of the arm
/// become `None`: the arm was outside before, and holds there.
pub fn keep_limits(limits: u8, present: &[u16; JOINTS], written: &mut [Option<u16>; JOINTS]) {
    let [_, two, three, .., seven] = written;
    let &[_, two_now, three_now, .., seven_now] = present;
    let claw_max = DEGREE * u16::from(limit::CLAW_MAX);
    if limits & limit::CLAW != 0 && seven.is_some_and(|target| target > claw_max) {
        *seven = seven.filter(|&target| target != seven_now).map(|_| claw_max);
    }
    if limits & limit::LINKAGE != 0 {
        keep_linkage([two_now, three_now], [two, three]);
    }
}

fn keep_linkage(present: [u16; 2], written: [&mut Option<u16>; 2]) {
    let [two, three] = written;
    let wanted = [two.unwrap_or(present[0]), three.unwrap_or(present[1])];
    let excess = linkage_excess(wanted);
    if excess == 0 {
        return;
    }
    if wanted == present {
        (*two, *three) = (None, None);
        return;
    }
    let goes_inwards =
        two.is_some_and(|measured| (measured > present[0]) == (excess > 0) && measured != present[0]);
    let target = if goes_inwards || three.is_none() { two } else { three };
    *target = target.and_then(|target| u16::try_from(i32::from(target) - excess).ok());
}

/// How far the sum of the angles of joints 2 and 3 is outside its limits, in hundredths of a degree: positive above the
/// largest sum, negative below the smallest, otherwise 0.
fn linkage_excess([two, three]: [u16; 2]) -> i32 {
    let (min, max) = limit::LINKAGE_SUM;
    let [min, max] = [min, max].map(|degrees| i32::from(DEGREE) * i32::from(degrees));
    let sum = i32::from(two) + i32::from(three);
    if sum > max { sum - max } else { (sum - min).min(0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINKAGE: u8 = limit::LINKAGE;
    const CLAW: u8 = limit::CLAW;

    /// The targets of joints 2, 3 and 7 after [`keep_limits`]: `present` are the arm's, `written` those to be written.
    fn kept(limits: u8, present: [u16; 3], written: [Option<u16>; 3]) -> [Option<u16>; 3] {
        let [two, three, seven] = written;
        let mut targets = [Some(1), two, three, None, None, None, seven];
        keep_limits(limits, &[1, present[0], present[1], 1, 1, 1, present[2]], &mut targets);
        assert_eq!((targets[0], targets[3]), (Some(1), None), "other joints");
        [targets[1], targets[2], targets[6]]
    }

    #[test]
    fn d25_the_joint_on_its_way_inwards_goes_on_until_the_linkage_allows_it() {
        let measured = [Some(12_900), Some(9_900), Some(8_000)];
        let inwards = [Some(12_700), Some(9_900), Some(8_000)];
        assert_eq!(kept(LINKAGE, [7_600, 15_000, 8_000], measured), inwards, "joint 2 goes down");
        let inwards = [Some(12_900), Some(9_700), Some(8_000)];
        assert_eq!(kept(LINKAGE, [15_000, 7_600, 8_000], measured), inwards, "joint 3 goes down");
        assert_eq!(kept(0, [7_600, 15_000, 8_000], measured), measured, "the limit is off");
        let low = [Some(3_000), Some(5_000), None];
        assert_eq!(
            kept(LINKAGE, [2_000, 7_000, 0], low),
            [Some(3_000), Some(5_400), None],
            "the lower limit"
        );
        assert_eq!(kept(LINKAGE, [7_600, 9_900, 0], [Some(12_900), None, None]), [Some(12_700), None, None]);
        assert_eq!(kept(LINKAGE, [12_900, 0, 0], [None, Some(9_900), None]), [None, Some(9_700), None]);
    }

    #[test]
    fn d25_an_arm_that_was_outside_before_holds_there() {
        let outside = [13_000, 12_000, 9_000];
        assert_eq!(kept(LINKAGE | CLAW, outside, outside.map(Some)), [None; 3]);
        let moved = [Some(13_000), Some(12_100), Some(9_100)];
        assert_eq!(kept(LINKAGE | CLAW, outside, moved), [Some(13_000), Some(9_600), Some(8_400)]);
    }
}
