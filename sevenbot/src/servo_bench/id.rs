//! Gives the only servo on the bus another id.
//!
//! Two servos with one id cannot be told apart any more, so nothing is written unless exactly one servo answers.

use std::fmt;
use std::time::Duration;

use motion_core::servo_bus::frame::register;

use super::bus::ServoBus;
use super::error::ServoError;
use super::scan::{Answers, Found, Plan, Step, scan};

/// Register 48, the lock of the EEPROM.
const OPEN: [u8; 1] = [0];
const LOCKED: [u8; 1] = [1];

/// Why a servo does not have its new id.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IdError {
    /// Other servos answer, or none, or several with one id. Nothing was written.
    NotAlone {
        /// Whatever answers.
        answering: Vec<Found>,
    },
    /// The servo does not open its EEPROM. Nothing else was written.
    StaysLocked(ServoError),
    /// The servo did not take the new id: it still answers to the old one.
    Unchanged,
    /// The servo answers to neither id.
    Lost,
    /// Something answers to the old id and to the new one.
    AnswersToBoth,
    /// The servo has its new id, but its EEPROM is still unlocked.
    StaysOpen(ServoError),
    /// The port failed after the EEPROM was unlocked.
    HalfWay(ServoError),
    /// The exchange failed before anything was written.
    Bus(ServoError),
}

impl From<ServoError> for IdError {
    fn from(error: ServoError) -> Self {
        Self::Bus(error)
    }
}

impl fmt::Display for IdError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAlone { answering } if answering.is_empty() => {
                out.write_str("no servo answers at this baud rate")
            }
            Self::NotAlone { answering } => {
                let ids: Vec<String> = answering.iter().map(word).collect();
                write!(
                    out,
                    "the servo has to be the only one on the bus, but these ids answer: {}",
                    ids.join(", ")
                )
            }
            Self::StaysLocked(error) => write!(out, "the servo's EEPROM stays locked: {error}"),
            Self::Unchanged => {
                out.write_str("the servo did not take the new id: it still answers to the old one")
            }
            Self::Lost => out.write_str("the servo answers neither to the old id nor to the new one"),
            Self::AnswersToBoth => out.write_str("something answers to the old id and to the new one"),
            Self::StaysOpen(error) => {
                write!(out, "the servo has its new id, but its EEPROM was not locked again: {error}")
            }
            Self::HalfWay(error) => write!(out, "{error}; the servo may have its old id or its new one"),
            Self::Bus(error) => error.fmt(out),
        }
    }
}

fn word(found: &Found) -> String {
    match found.answers {
        Answers::Good => found.id.to_string(),
        Answers::Several => format!("{} (several servos)", found.id),
        Answers::Damaged => format!("{} (damaged answers)", found.id),
    }
}

impl std::error::Error for IdError {}

/// Changes the id of the only servo on the bus from `old` to `new`, and makes sure of it.
///
/// # Errors
/// See [`IdError`]; each says what state the servo is in.
pub fn set_id(
    bus: &mut ServoBus,
    plan: &Plan,
    old: u8,
    new: u8,
    tell: impl FnMut(Step),
) -> Result<(), IdError> {
    let answering = scan(bus, plan, tell)?.found;
    if !matches!(answering.as_slice(), [Found { id, answers: Answers::Good, .. }] if *id == old) {
        return Err(IdError::NotAlone { answering });
    }
    bus.write(old, register::LOCK, &OPEN).map_err(IdError::StaysLocked)?;
    let changed = change(bus, old, new);
    // Whatever came of it, no servo is left open.
    let holder = if changed.is_ok() { new } else { old };
    let locked = bus.write(holder, register::LOCK, &LOCKED);
    changed?;
    locked.map_err(IdError::StaysOpen)
}

/// Writes the id until the servo answers to it. Its acknowledgement may carry either id, so it counts for nothing.
fn change(bus: &mut ServoBus, old: u8, new: u8) -> Result<(), IdError> {
    for _ in 0..bus.options().attempts.max(1) {
        bus.send_write(old, register::ID, &[new]).map_err(IdError::HalfWay)?;
        match (is_there(bus, new)?, is_there(bus, old)?) {
            (true, false) => return Ok(()),
            (true, true) => return Err(IdError::AnswersToBoth),
            (false, _) => {}
        }
    }
    Err(if is_there(bus, old)? { IdError::Unchanged } else { IdError::Lost })
}

/// Does a servo answer to this id?
fn is_there(bus: &mut ServoBus, id: u8) -> Result<bool, IdError> {
    match bus.read(id, register::ID, 1) {
        Ok(answer) => Ok(answer.values == [id]),
        Err(ServoError::NoAnswer { .. }) => Ok(false),
        Err(error) => Err(IdError::HalfWay(error)),
    }
}

/// A plan for [`set_id`]: every id at one rate.
#[must_use]
pub fn everything_at(baud: u32, wait: Option<Duration>) -> Plan {
    Plan { rates: vec![baud], ids: 0..=super::MAX_ID, wait }
}
