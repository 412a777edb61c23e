//! One file a command: its arguments, and what it does in a session.

pub(crate) mod backup;
pub(crate) mod baud;
pub(crate) mod calibrate;
pub(crate) mod effector;
pub(crate) mod get;
pub(crate) mod info;
pub(crate) mod monitor;
pub(crate) mod play;
pub(crate) mod ports;
pub(crate) mod pose;
pub(crate) mod record;
pub(crate) mod registers;
pub(crate) mod servo;
pub(crate) mod set;
pub(crate) mod shell;
pub(crate) mod sniff;
pub(crate) mod state;
pub(crate) mod stop;

use sevenbot::Error;
use sevenbot::change::Unchanged;
use sevenbot::names::name_of_register;

use crate::failure::Failure;

/// A command that wanted these registers changed fails with the reasons of those that are not.
pub(crate) fn all_taken(unchanged: &[Unchanged]) -> Result<(), Failure> {
    if unchanged.is_empty() { Ok(()) } else { Err(Failure::Arm(reasons(unchanged))) }
}

/// As [`all_taken`], for registers that move the arm or change its motors' state: where it is not known what the arm
/// has taken, it may be moving.
pub(crate) fn motors_obey(written: Result<Vec<Unchanged>, Error>) -> Result<(), Failure> {
    match written {
        Ok(unchanged) if unchanged.iter().any(|register| register.cause.may_pass()) => {
            Err(Failure::MayMove(reasons(&unchanged)))
        }
        Ok(unchanged) => all_taken(&unchanged),
        Err(error) => Err(Failure::MayMove(error.to_string())),
    }
}

fn reasons(unchanged: &[Unchanged]) -> String {
    let groups = unchanged.chunk_by(|one, next| one.cause == next.cause);
    groups.map(reason).collect::<Vec<String>>().join("\n       ")
}

/// One reason for all registers that share it.
fn reason(unchanged: &[Unchanged]) -> String {
    match unchanged {
        [only] => only.to_string(),
        [first, .., last] => {
            let (from, to) = (name_of_register(first.address), name_of_register(last.address));
            format!("{from} to {to} did not change: {}", first.cause)
        }
        [] => String::new(),
    }
}
