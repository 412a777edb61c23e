//! What must never happen, and did.

use std::fmt::{self, Display};

/// A rule that was broken, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation(pub String);

impl Display for Violation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.0)
    }
}

/// What a check comes to.
pub type Check<T = ()> = Result<T, Violation>;

/// Breaks a rule, with `what` as the words, unless it `holds`.
///
/// # Errors
/// The rule does not hold.
pub fn ensure(holds: bool, what: impl FnOnce() -> String) -> Check {
    if holds { Ok(()) } else { Err(Violation(what())) }
}
