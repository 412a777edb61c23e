//! The verdict of the limits on a write (D25). This file does not know the register map.

pub(crate) use crate::linkage_goals::LINKAGE;

/// The largest angle of joint 7, in microdegrees.
pub(crate) const CLAW: i32 = 84_000_000;

/// The verdict of a limit on a write, as far as a model knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LimitVerdict {
    Allowed,
    /// Refused because of this register.
    Refused(u8),
    /// The outcome depends on set-points, or on targets that a measured position may have replaced. A refusal would name this
    /// register.
    Unknown(u8),
}

/// The possible outcomes of a write under both limits: the register that a refusal names, which is the lowest one, or `None`
/// if the write is accepted.
pub(crate) fn outcomes([one, other]: [LimitVerdict; 2]) -> Vec<Option<u8>> {
    let of = |verdict| match verdict {
        LimitVerdict::Allowed => vec![None],
        LimitVerdict::Refused(at) => vec![Some(at)],
        LimitVerdict::Unknown(at) => vec![None, Some(at)],
    };
    let pairs = of(one).into_iter().flat_map(|one| of(other).into_iter().map(move |other| [one, other]));
    let mut outcomes: Vec<_> = pairs.map(|pair| pair.into_iter().flatten().min()).collect();
    outcomes.sort_unstable();
    outcomes.dedup();
    outcomes
}

#[cfg(test)]
mod tests {
    use super::LimitVerdict::{Allowed, Refused, Unknown};
    use super::*;

    #[test]
    fn the_lowest_register_of_both_limits_counts() {
        assert_eq!(outcomes([Allowed, Allowed]), [None]);
        assert_eq!(outcomes([Unknown(47), Refused(140)]), [Some(47), Some(140)]);
        assert_eq!(outcomes([Unknown(188), Refused(188)]), [Some(188)]);
        assert_eq!(outcomes([Unknown(47), Unknown(52)]), [None, Some(47), Some(52)]);
    }
}
