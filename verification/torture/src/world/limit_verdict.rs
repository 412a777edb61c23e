//! What the limits say to a write (D25). This file does not know registers.

/// The smallest and the largest sum of the angles of joints 2 and 3: 19 to 161 degrees, plus 65.
pub(super) const LINKAGE: (i32, i32) = (84_000_000, 226_000_000);
/// The largest angle of joint 7.
pub(super) const CLAW: i32 = 84_000_000;

/// What a model can tell about a write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LimitVerdict {
    Allowed,
    /// Refused because of this register.
    Refused(u8),
    /// It depends on set-points or measured targets. If it is refused, this is the register.
    Unknown(u8),
}

/// Both limits: the lowest register counts.
pub(super) fn combined(verdicts: [LimitVerdict; 2]) -> LimitVerdict {
    use LimitVerdict::{Allowed, Refused, Unknown};
    match verdicts {
        [Allowed, other] | [other, Allowed] => other,
        [Refused(a), Refused(b)] => Refused(a.min(b)),
        // Switched on together, or of a lower register: the verdict does not depend on what is unknown.
        [Refused(a), Unknown(b)] | [Unknown(b), Refused(a)] if a <= b => Refused(a),
        [Unknown(a) | Refused(a), Unknown(b) | Refused(b)] => Unknown(a.min(b)),
    }
}
