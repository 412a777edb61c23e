//! Checks that the goals of joints 2 and 3 keep the linkage (D25). This file does not know registers.

use motion_core::calibration::{MicroDegrees, angle_from_counts};
use protocol_core::registers::Joint;

use crate::violation::{Check, ensure};

/// The smallest and the largest sum of the angles of joints 2 and 3, in microdegrees: 19 to 161 degrees, plus 65.
pub(crate) const LINKAGE: (i32, i32) = (84_000_000, 226_000_000);
/// Goals are rounded to counts of up to 0.212 degrees. This allows two counts of each of the two joints, in microdegrees.
const ROUNDING: i32 = 2 * 2 * 212_000;

/// The smallest excess of the goals over the linkage since the last reset, in microdegrees; `None` before the first
/// check.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LinkageGoals(Option<i32>);

impl LinkageGoals {
    /// Forgets the smallest excess, for example because a joint engaged anew, an offset changed, or the limit is off.
    pub(crate) fn reset(&mut self) {
        self.0 = None;
    }

    /// Checks the goals of joints 2 and 3 in counts, with the offsets of these joints; `None` for a joint that is not
    /// driven. If the first goals are outside the linkage, where a hand may have left the arm, later goals must not move
    /// outwards.
    pub(crate) fn check(&mut self, goals: [Option<u16>; 2], offsets: [i8; 2]) -> Check {
        let [Some(two), Some(three)] = goals else {
            self.reset();
            return Ok(());
        };
        let [_, second, third, ..] = Joint::ALL;
        let [MicroDegrees(two), MicroDegrees(three)] =
            [(second, two, offsets[0]), (third, three, offsets[1])]
                .map(|(joint, counts, offset)| angle_from_counts(joint, counts, offset));
        let excess = (two + three - LINKAGE.1).max(LINKAGE.0 - two - three).max(0);
        let most = self.0.unwrap_or(excess);
        self.0 = Some(most.min(excess));
        ensure(excess <= most + ROUNDING, || {
            format!(
                "joints 2 and 3 at {two} and {three} microdegrees are {excess} outside the linkage after {most}"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use motion_core::calibration::counts_from_angle;

    use super::*;

    #[test]
    fn d25_goals_outside_the_linkage_are_a_violation_unless_they_come_back() {
        let counts = |two, three| {
            let of = |joint, degrees| Some(counts_from_angle(joint, MicroDegrees::from_degrees(degrees), 0));
            [of(Joint::ALL[1], two), of(Joint::ALL[2], three)]
        };
        let mut goals = LinkageGoals::default();
        let mut check = |pair| goals.check(pair, [0; 2]).is_ok();
        assert!(check(counts(90, 90)) && !check(counts(20, 20)));
        goals.reset();
        let mut check = |pair| goals.check(pair, [0; 2]).is_ok();
        assert!(check(counts(20, 20)) && check(counts(20, 30)), "inwards, from where a hand left it");
        assert!(!check(counts(20, 20)), "outwards");
        assert!(check([None, counts(20, 20)[1]]) && check(counts(20, 20)), "engaged anew");
    }
}
