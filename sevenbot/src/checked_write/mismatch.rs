//! The errors of a verified write: the registers that did not take or keep their values.

use std::fmt;

use protocol_core::registers::map21::find_readable;

use super::cause::MismatchCause;
use crate::error::Error;
use crate::names::name_of_register;

/// A register that does not hold what was written to it, or may not keep it: [`MismatchCause::NotStored`].
///
/// ```
/// use sevenbot::checked_write::{MismatchCause, WriteMismatch};
///
/// let refused = WriteMismatch { address: 11, wanted: 42, found: 0, cause: MismatchCause::Locked };
/// assert_eq!(refused.to_string(), "device-id is 0, not 42: it is protected by the EEPROM lock");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WriteMismatch {
    /// The address of the register; of a two-byte register that was written whole, its low byte.
    pub address: u8,
    /// The raw value that was written. For a two-byte register that was written whole, both bytes as one number.
    pub wanted: u16,
    /// The raw value that was read back.
    pub found: u16,
    /// Why the register does not hold what was written.
    pub cause: MismatchCause,
}

/// Registers that do not hold or keep what was written to them: at least one.
///
/// ```
/// use sevenbot::checked_write::{MismatchCause, NotTaken, WriteMismatch};
///
/// let locked = WriteMismatch { address: 11, wanted: 42, found: 0, cause: MismatchCause::Locked };
/// let error = NotTaken::check(vec![locked]).expect_err("one register differs");
/// assert_eq!(error.to_string(), "device-id is 0, not 42: it is protected by the EEPROM lock");
/// assert_eq!(NotTaken::check(Vec::new()), Ok(()));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", reasons(.0))]
pub struct NotTaken(pub(super) Vec<WriteMismatch>);

impl NotTaken {
    /// Fails if there are registers in `differing`.
    ///
    /// # Errors
    /// All registers of `differing`.
    pub fn check(differing: Vec<WriteMismatch>) -> Result<(), Self> {
        if differing.is_empty() { Ok(()) } else { Err(Self(differing)) }
    }

    /// The registers. Those of one write are in the order of their addresses.
    #[must_use]
    pub fn registers(&self) -> &[WriteMismatch] {
        &self.0
    }

    /// Is a register protected by the EEPROM lock?
    #[must_use]
    pub fn is_locked(&self) -> bool {
        self.0.iter().any(|register| register.cause == MismatchCause::Locked)
    }
}

/// Why a verified write failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WriteError {
    /// These registers did not take or keep their values.
    #[error(transparent)]
    NotTaken(#[from] NotTaken),
    /// An exchange with the arm failed. The arm may have taken some of the values.
    #[error(transparent)]
    Exchange(#[from] Error),
}

impl WriteError {
    /// Is it unknown whether the arm carries out the write?
    #[must_use]
    pub fn is_uncertain(&self) -> bool {
        match self {
            Self::NotTaken(not_taken) => {
                not_taken.registers().iter().any(|register| register.cause.is_transient())
            }
            Self::Exchange(_) => true,
        }
    }
}

/// The text for [`MismatchCause::NotStored`]. It says "may", because a storage that becomes full also sets the fault bit,
/// although it stored the setting.
const NOT_STORED: &str = "may be lost when the arm is switched off";

/// The number that a raw value encodes. Minus zero is zero (D9).
pub(super) fn number(address: u8, raw: u16) -> i32 {
    find_readable(address).map_or(i32::from(raw), |row| row.range.decode(raw))
}

/// The reasons as text: one line for each run of registers with the same cause.
#[must_use]
pub fn reasons(unchanged: &[WriteMismatch]) -> String {
    let width = |of: &WriteMismatch| find_readable(of.address).map_or(1, |row| row.range.width());
    let is_next =
        |one: &WriteMismatch, next: &WriteMismatch| one.address.checked_add(width(one)) == Some(next.address);
    let groups = unchanged.chunk_by(|one, next| one.cause == next.cause && is_next(one, next));
    groups.map(reason).collect::<Vec<String>>().join("\n       ")
}

/// The line for one run of registers with the same cause.
fn reason(unchanged: &[WriteMismatch]) -> String {
    match unchanged {
        [only] => only.to_string(),
        [first, .., last] => {
            let (from, to) = (name_of_register(first.address), name_of_register(last.address));
            let fault = if first.cause == MismatchCause::NotStored { NOT_STORED } else { "did not change" };
            format!("{from} to {to} {fault}: {}", first.cause)
        }
        [] => String::new(),
    }
}

impl fmt::Display for WriteMismatch {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (found, wanted) = (number(self.address, self.found), number(self.address, self.wanted));
        let (name, cause) = (name_of_register(self.address), self.cause);
        match cause {
            MismatchCause::NotStored => write!(out, "{name} is {found}, but {NOT_STORED}: {cause}"),
            _ => write!(out, "{name} is {found}, not {wanted}: {cause}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_names_only_registers_that_were_written() {
        let mismatch = |address| WriteMismatch { address, wanted: 9, found: 0, cause: MismatchCause::Locked };
        // Fine targets have two bytes.
        let text = reasons(&[11, 13, 14, 128, 130].map(mismatch));
        let lines: Vec<_> = text.lines().map(str::trim).collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert!(
            lines[0].starts_with("device-id is") && lines[1].starts_with("offset.1 to offset.2"),
            "{text}"
        );
        assert!(lines[2].starts_with("fine-target.1 to fine-target.2"), "{text}");
        assert_eq!(reasons(&[189, 53].map(mismatch)).lines().count(), 2, "in the order of the writes");
    }
}
