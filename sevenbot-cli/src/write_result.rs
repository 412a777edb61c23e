//! The result of a checked write as the result of a command.

use sevenbot::Error;
use sevenbot::checked_write::WriteMismatch;
use sevenbot::names::name_of_register;

use crate::command_error::CommandError;

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

fn reasons(unchanged: &[WriteMismatch]) -> String {
    let groups = unchanged.chunk_by(|one, next| one.cause == next.cause);
    groups.map(reason).collect::<Vec<String>>().join("\n       ")
}

/// One reason for all registers that share it.
fn reason(unchanged: &[WriteMismatch]) -> String {
    match unchanged {
        [only] => only.to_string(),
        [first, .., last] => {
            let (from, to) = (name_of_register(first.address), name_of_register(last.address));
            format!("{from} to {to} did not change: {}", first.cause)
        }
        [] => String::new(),
    }
}
