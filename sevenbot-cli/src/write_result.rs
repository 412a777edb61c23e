//! The result of a checked write as the result of a command.

use sevenbot::checked_write::{WriteMismatch, reasons};
use sevenbot::map::{BAUD_RATE, OFFSET};
use sevenbot::{Arm, Error, Firmware};

use crate::command_error::CommandError;
use crate::printer::note;

/// Fails with the reasons if any register did not take its value.
pub(crate) fn all_taken(unchanged: &[WriteMismatch]) -> Result<(), CommandError> {
    if unchanged.is_empty() { Ok(()) } else { Err(CommandError::Arm(reasons(unchanged))) }
}

/// As [`all_taken`], for registers that move the arm. If the result of the write is unknown the arm may be moving.
pub(crate) fn motors_obey(written: Result<Vec<WriteMismatch>, Error>) -> Result<(), CommandError> {
    match written {
        Ok(unchanged) if unchanged.iter().any(|register| register.cause.is_transient()) => {
            Err(CommandError::MayMove(reasons(&unchanged)))
        }
        Ok(unchanged) => all_taken(&unchanged),
        Err(error) => Err(CommandError::MayMove(error.to_string())),
    }
}

/// Says which of these new settings act only after a restart of the arm.
pub(crate) fn note_restart(arm: &Arm, mut changed: impl Iterator<Item = u8> + Clone) {
    if changed.clone().any(|address| BAUD_RATE.holds(address)) {
        note("the new baud rate is in force after the next restart of the arm");
    }
    if uses_offsets_after_restart(arm) && changed.any(|address| OFFSET.holds(address)) {
        note("the maker's firmware uses new offsets after its next restart");
    }
}

/// Do new offsets act only after a restart? Ours act at once (D9).
pub(crate) fn uses_offsets_after_restart(arm: &Arm) -> bool {
    arm.identity().firmware() == Firmware::Makers
}
