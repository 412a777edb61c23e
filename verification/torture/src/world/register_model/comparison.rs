//! Compares the model with the registers of the arm.

use protocol_core::registers::map::{PRESENT_POSITION, TARGET_POSITION};
use protocol_core::registers::{Joint, RegisterFile};

use super::super::{extended_model, map21_model};
use super::{OwnTarget, RegisterModel};
use crate::violation::{Check, ensure};

/// The ranges of registers whose values the model knows: first and last address.
const MODELLED: &[(u8, u8)] = &[
    (0, 45),
    (53, 53),
    (61, 82),
    (90, 90),
    (98, 127),
    (184, 189),
    (191, 194),
    (198, 240),
    (244, 247),
    (250, 251),
];

impl RegisterModel {
    /// The values that a read shows.
    fn shown(&self, first: u8, last: u8) -> Vec<u8> {
        let shown = |at| match self.has_biased_offsets {
            true => map21_model::shown(at, self.get(at)),
            false => self.get(at),
        };
        (first..=last).map(shown).collect()
    }

    /// Compares the model with the registers of the arm. Also checks that registers 83 to 89 repeat 54 to 60, and that the loads
    /// in 91 to 97 are in range (M9).
    pub(crate) fn compare(&self, registers: &RegisterFile) -> Check {
        for (first, last) in MODELLED {
            let ours = self.shown(*first, *last);
            let theirs = registers.read(*first, last - first + 1);
            ensure(ours == theirs, || {
                let differs = (*first..).zip(ours.iter().zip(theirs)).find(|(_, (a, b))| a != b);
                let (at, (wanted, found)) = differs.unwrap_or((0, (&0, &0)));
                format!("register {at} holds {found} instead of {wanted}")
            })?;
        }
        let [angles, positions] = [83, 54].map(|first| registers.read(first, 7));
        ensure(angles == positions, || format!("angles {angles:?} of positions {positions:?}"))?;
        let loads = registers.read(91, 7);
        ensure(loads.iter().all(|load| (3..=253).contains(load)), || format!("loads {loads:?}"))
    }

    /// True if the registers of the arm agree with the model.
    pub(crate) fn fits(&self, registers: &RegisterFile) -> bool {
        self.compare(registers).is_ok() && self.clone().compare_targets(registers).is_ok()
    }

    /// Compares the fine targets that the arm computed for the present reply with the model (D21).
    pub(crate) fn compare_fine_targets(&self, registers: &RegisterFile) -> Check {
        Joint::ALL.into_iter().try_for_each(|joint| {
            let shown = extended_model::word_of(registers, extended_model::fine_target(joint));
            let coarse = u16::from(self.get(TARGET_POSITION.of(joint))) * 100;
            let is_right = match self.targets[joint] {
                Some(target) => shown == extended_model::hundredths(target),
                // Both registers show one angle, and the coarse one is rounded to a degree.
                None => shown <= 18_000 && shown.abs_diff(coarse) <= 50,
            };
            ensure(is_right, || {
                format!("fine target {} is {shown} instead of {:?}", joint.number(), self.targets[joint])
            })
        })
    }

    /// Checks that a target that differs from the model is the measured position (D12, D13), the goal that a servo held when
    /// the controller started (D12), or one that the arm may have set (D27, D28). The model then takes over the arm's target.
    pub(crate) fn compare_targets(&mut self, registers: &RegisterFile) -> Check {
        for joint in Joint::ALL {
            let (at, found) = (TARGET_POSITION.of(joint), registers.get(TARGET_POSITION.of(joint)));
            if self.own_targets[joint] != OwnTarget::Measured {
                self.forget_target(joint);
            }
            if found == self.get(at) {
                continue;
            }
            let present = registers.get(PRESENT_POSITION.of(joint));
            let own = self.own_targets[joint];
            let is_own = own.may_be(found) || own.is_without_streams() && found == self.firm_targets[joint];
            let is_held = self.held_targets[joint] == Some(found);
            ensure(found == present || is_held || is_own, || {
                let wanted = self.get(at);
                let number = joint.number();
                format!(
                    "target {number} is {found}: the host wrote {wanted}, and the joint was at {present} ({own:?})"
                )
            })?;
            self.take_target(joint, found);
        }
        Ok(())
    }
}
