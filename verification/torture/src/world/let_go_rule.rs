//! The target of a joint that is let go follows its measured position, unless the host writes one (D28).

use protocol_core::registers::map::{PRESENT_POSITION, TARGET_POSITION};
use protocol_core::registers::{Joint, RegisterFile};

use super::protection_model::{LET_GO, PROTECTION};
use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};

/// A joint that is let go. At the first read of this state, its target was its measured position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Freed {
    /// Its measured position, and its target, in degrees.
    present: u8,
    target: u8,
    /// True if the target does not follow the position yet. The answer that shows that the servo let go updates the position,
    /// but not always the target. The next answer updates the target.
    is_behind: bool,
    /// The number of times that the host has written the target.
    writes: u64,
}

/// The joints that are let go.
#[derive(Clone, Copy, Debug)]
pub(super) struct LetGoRule(PerJoint<Option<Freed>>);

impl LetGoRule {
    /// The rule at the start: no joint is let go.
    pub(super) const NONE: Self = Self(PerJoint::all(None));

    /// Checks the registers, which the host reads now. `writes` holds how often the host wrote each target. `keeps_target` is
    /// true for a joint whose last target was written while the joint may have been let go.
    pub(super) fn check(
        &mut self,
        registers: &RegisterFile,
        writes: &PerJoint<u64>,
        keeps_target: impl Fn(Joint) -> bool,
    ) -> Check {
        for joint in Joint::ALL {
            let [target, present] =
                [TARGET_POSITION, PRESENT_POSITION].map(|row| registers.get(row.of(joint)));
            let writes = writes[joint];
            let is_let_go = registers.get(PROTECTION) == 1
                && registers.get(LET_GO) & joint.bit() != 0
                && !keeps_target(joint);
            let before = self.0[joint].filter(|before| is_let_go && before.writes == writes);
            let has_turned = before.is_some_and(|before| before.present != present);
            let was_behind = before.is_some_and(|before| before.is_behind && before.target == target);
            ensure(!has_turned || !was_behind || target == present, || {
                let number = joint.number();
                format!("joint {number} is let go and turned to {present}, and its target stayed at {target}")
            })?;
            let is_behind = target != present && (has_turned || was_behind);
            let freed = Freed { present, target, is_behind, writes };
            self.0[joint] = is_let_go.then_some(freed).filter(|_| before.is_some() || target == present);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINT: Joint = Joint::ALL[1];

    /// Joint 2 is let go at 90 degrees, and falls to 80 and to 70 degrees. At 70 degrees its target is `target`, and the
    /// host has written the target `writes` times.
    fn check(target: u8, writes: u64) -> Check {
        let mut registers = RegisterFile::new([0; 6], None);
        registers.set(PROTECTION, 1);
        registers.set(LET_GO, JOINT.bit());
        let mut rule = LetGoRule::NONE;
        for (present, target, writes) in [(90, 90, 5), (80, 90, 5), (70, target, writes)] {
            registers.set(PRESENT_POSITION.of(JOINT), present);
            registers.set(TARGET_POSITION.of(JOINT), target);
            rule.check(&registers, &PerJoint::all(writes), |_| false)?;
        }
        Ok(())
    }

    #[test]
    fn a_target_that_stays_breaks_the_rule_unless_the_host_wrote_it() {
        assert!(check(70, 5).is_ok() && check(80, 5).is_ok());
        assert!(check(90, 5).is_err());
        assert!(check(90, 6).is_ok());
    }
}
