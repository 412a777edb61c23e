//! Violated rules.

use std::fmt::{self, Display};

/// The description of a violated rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation(pub String);

impl Display for Violation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.0)
    }
}

/// The result of a check: an error is the rule that does not hold.
pub type Check<T = ()> = Result<T, Violation>;

/// Returns a violation with the description `what`, unless the rule `holds`.
///
/// # Errors
/// The rule does not hold.
pub fn ensure(holds: bool, what: impl FnOnce() -> String) -> Check {
    if holds { Ok(()) } else { Err(Violation(what())) }
}
