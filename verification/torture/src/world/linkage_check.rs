//! Checks that the goals of joints 2 and 3 keep the linkage (D25).

use motion_core::calibration::{MicroDegrees, angle_from_counts};
use protocol_core::registers::Joint;
use protocol_core::registers::map::limit;

use super::extended_model::LIMITS;
use super::limit_verdict::LINKAGE;
use super::register_model::RegisterModel;
use crate::violation::{Check, ensure};

/// One count of each of both joints, in microdegrees.
const ROUNDING: i32 = 2 * 212_000;

/// How far the goals were outside the linkage, in microdegrees.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LinkageCheck(Option<i32>);

impl LinkageCheck {
    /// Checks the goals of joints 2 and 3; `None` for a joint that is not driven. From outside, where a hand may have left
    /// the arm, goals move only inwards.
    pub(super) fn check(&mut self, goals: [Option<u16>; 2], model: &RegisterModel) -> Check {
        let [Some(two), Some(three)] = goals else {
            self.0 = None;
            return Ok(());
        };
        if model.get(LIMITS) & limit::LINKAGE == 0 {
            self.0 = None;
            return Ok(());
        }
        let [_, second, third, ..] = Joint::ALL;
        let [MicroDegrees(a), MicroDegrees(b)] = [(second, two), (third, three)]
            .map(|(joint, counts)| angle_from_counts(joint, counts, model.offset(joint)));
        let excess = (a + b - LINKAGE.1).max(LINKAGE.0 - a - b).max(0);
        let most = self.0.unwrap_or(excess);
        self.0 = Some(most.min(excess));
        ensure(excess <= most + ROUNDING, || {
            format!(
                "joints 2 and 3 at {a} and {b} microdegrees are {excess} outside the linkage after {most}"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use motion_core::Storage;
    use motion_core::calibration::counts_from_angle;

    use super::super::host_request::HostRequest;
    use super::*;

    #[test]
    fn goals_outside_the_linkage_are_a_violation_unless_they_come_back() {
        let mut model = RegisterModel::new([0; 6], None, Storage::Ready);
        let [_, second, third, ..] = Joint::ALL;
        let counts = |two, three| {
            let of = |joint, degrees| Some(counts_from_angle(joint, MicroDegrees::from_degrees(degrees), 0));
            [of(second, two), of(third, three)]
        };
        let mut off = LinkageCheck::default();
        assert!(off.check(counts(90, 90), &model).is_ok() && off.check(counts(20, 20), &model).is_ok());
        model.execute(&HostRequest::Write { address: LIMITS, values: vec![1] }, 0);
        let mut on = LinkageCheck::default();
        assert!(on.check(counts(90, 90), &model).is_ok() && on.check(counts(20, 20), &model).is_err());
        let mut outside = LinkageCheck::default();
        assert!(outside.check(counts(20, 20), &model).is_ok(), "where a hand left it");
        assert!(
            outside.check(counts(20, 30), &model).is_ok() && outside.check(counts(20, 20), &model).is_err()
        );
    }
}
