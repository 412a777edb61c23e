//! Gives the only servo on the bus another id.
//!
//! Two servos with the same id cannot be told apart. So nothing is written unless exactly one servo answers.

use motion_core::servo_bus::frame::register;

use super::bus_master::BusMaster;
use super::error::ServoError;
use super::scan::{AnswerQuality, FoundServo, ScanPlan, ScanProgress, scan};

/// The value of register 48 that opens the EEPROM.
const OPEN: [u8; 1] = [0];
/// The value of register 48 that locks the EEPROM.
const LOCKED: [u8; 1] = [1];

/// Why a servo does not have its new id.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetIdError {
    /// No servo answers, several do, or the only one has another id or gives damaged answers. Nothing was written.
    #[error("{}", not_alone(answering))]
    NotAlone {
        /// All ids that answer at the rates of the plan.
        answering: Vec<FoundServo>,
    },
    /// The EEPROM cannot be unlocked. The id was not written.
    #[error("the servo's EEPROM stays locked: {0}")]
    StaysLocked(ServoError),
    /// The servo still answers to the old id.
    #[error("the servo did not take the new id: it still answers to the old one")]
    Unchanged,
    /// The servo answers to neither id.
    #[error("the servo answers neither to the old id nor to the new one")]
    Lost,
    /// Something answers to the old id and to the new one.
    #[error("something answers to the old id and to the new one")]
    AnswersToBoth,
    /// The servo has its new id, but its EEPROM cannot be locked again.
    #[error("the servo has its new id, but its EEPROM was not locked again: {0}")]
    StaysOpen(ServoError),
    /// The port failed after the EEPROM was unlocked: the id may be the old or the new one.
    #[error("{0}; the servo may have its old id or its new one")]
    IdUncertain(ServoError),
    /// An exchange failed before anything was written.
    #[error(transparent)]
    Bus(#[from] ServoError),
}

fn not_alone(answering: &[FoundServo]) -> String {
    match answering {
        [] => return "no servo answers at this baud rate".to_owned(),
        [FoundServo { id, answers: AnswerQuality::Good, .. }] => {
            return format!("the only servo that answers has another id: {id}");
        }
        _ => {}
    }
    let ids: Vec<String> = answering.iter().map(id_text).collect();
    format!("the servo has to be the only one on the bus, but these ids answer: {}", ids.join(", "))
}

fn id_text(found: &FoundServo) -> String {
    match found.answers {
        AnswerQuality::Good => found.id.to_string(),
        answers => format!("{} ({})", found.id, answers.name()),
    }
}

/// Changes the id of the only servo on the bus from `old` to `new`, and verifies it.
///
/// # Errors
/// See [`SetIdError`]: each variant says which id the servo has, as far as known.
pub fn set_id(
    bus: &mut BusMaster,
    plan: &ScanPlan,
    old: u8,
    new: u8,
    on_progress: impl FnMut(ScanProgress),
) -> Result<(), SetIdError> {
    let answering = scan(bus, plan, on_progress)?.found;
    if !matches!(answering.as_slice(), [FoundServo { id, answers: AnswerQuality::Good, .. }] if *id == old) {
        return Err(SetIdError::NotAlone { answering });
    }
    bus.write(old, register::LOCK, &OPEN).map_err(SetIdError::StaysLocked)?;
    let changed = change(bus, old, new);
    // Lock the EEPROM again after a failure too.
    let holder = if changed.is_ok() { new } else { old };
    let locked = bus.write(holder, register::LOCK, &LOCKED);
    changed?;
    locked.map_err(SetIdError::StaysOpen)
}

/// Writes the id until the servo answers to it. Ignores the acknowledgement, which may carry either id.
fn change(bus: &mut BusMaster, old: u8, new: u8) -> Result<(), SetIdError> {
    for _ in 0..bus.options().attempts.max(1) {
        bus.send_write(old, register::ID, &[new]).map_err(SetIdError::IdUncertain)?;
        match (is_there(bus, new)?, is_there(bus, old)?) {
            (true, false) => return Ok(()),
            (true, true) => return Err(SetIdError::AnswersToBoth),
            (false, _) => {}
        }
    }
    Err(if is_there(bus, old)? { SetIdError::Unchanged } else { SetIdError::Lost })
}

/// Does a servo answer to this id?
fn is_there(bus: &mut BusMaster, id: u8) -> Result<bool, SetIdError> {
    match bus.read(id, register::ID, 1) {
        Ok(answer) => Ok(answer.values == [id]),
        Err(ServoError::NoAnswer { .. }) => Ok(false),
        Err(error) => Err(SetIdError::IdUncertain(error)),
    }
}
