//! Reads and writes the registers of a servo. A write checks the range, and the result by a read.

use motion_core::servo_bus::frame::{BAUD_RATES, register};

use super::bus_master::BusMaster;
use super::error::ServoError;
use super::register_table::{SERVO_REGISTERS, ServoMemory, ServoRegister};

/// The value of a register of one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoValue {
    /// The row of [`SERVO_REGISTERS`].
    pub register: ServoRegister,
    /// The value, with its sign.
    pub value: i32,
}

/// Why a register of a servo was not set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SetError {
    /// The register cannot be written. Nothing was sent.
    #[error("{0} cannot be written")]
    ReadOnly(&'static str),
    /// The value is out of range. Nothing was sent.
    #[error("{value} is out of range: {} takes {} to {}", register.name, register.range.0, register.range.1)]
    OutOfRange {
        /// The row of [`SERVO_REGISTERS`], with the range.
        register: ServoRegister,
        /// The value that was to be written.
        value: i32,
    },
    /// An id is set by [`set_id`](super::set_id::set_id), which first checks that only one servo answers. Nothing was sent.
    #[error("an id is set by `set-id`, which checks that exactly one servo answers")]
    IdNeedsCheck,
    /// The EEPROM cannot be opened. The register was not written.
    #[error("the servo's EEPROM stays locked: {0}")]
    StaysLocked(ServoError),
    /// The value was written, but the EEPROM cannot be locked again.
    #[error("the value was written, but the servo's EEPROM was not locked again: {0}")]
    StaysOpen(ServoError),
    /// An exchange failed, or the servo did not take the value.
    #[error(transparent)]
    Bus(#[from] ServoError),
}

/// Reads a register.
///
/// # Errors
/// The servo does not answer, or the port failed.
pub fn get(bus: &mut BusMaster, id: u8, register: &ServoRegister) -> Result<ServoValue, ServoError> {
    let answer = bus.read(id, register.address, register.width)?;
    Ok(ServoValue { register: *register, value: register.decode(&answer.values) })
}

/// Reads all registers, in two questions.
///
/// # Errors
/// The servo does not answer, or the port failed.
pub fn get_all(bus: &mut BusMaster, id: u8) -> Result<Vec<ServoValue>, ServoError> {
    let settings = bus.read(id, 0, register::TORQUE_SWITCH)?.values;
    let rest = bus.read(id, register::TORQUE_SWITCH, register::MOVING + 1 - register::TORQUE_SWITCH)?.values;
    let all = [settings, rest].concat();
    let value = |register: &ServoRegister| {
        let bytes = all.iter().skip(register.address.into()).take(register.width.into()).copied();
        ServoValue { register: *register, value: register.decode(&bytes.collect::<Vec<_>>()) }
    };
    Ok(SERVO_REGISTERS.iter().map(value).collect())
}

/// Writes a register, and reads it back. Opens the EEPROM for a register of the EEPROM, and locks it again.
///
/// A new baud rate of the servo becomes the rate of the bus, too.
///
/// # Errors
/// See [`SetError`]: each variant says whether the value was written, except for [`SetError::Bus`], after which it may be
/// written.
pub fn set(
    bus: &mut BusMaster,
    id: u8,
    register: &ServoRegister,
    value: i32,
) -> Result<ServoValue, SetError> {
    let bytes = register.encode(checked(register, value)?);
    if register.memory == ServoMemory::Eeprom {
        // Nothing is written to a servo that does not answer.
        bus.read(id, register::LOCK, 1)?;
        bus.write(id, register::LOCK, &[0]).map_err(SetError::StaysLocked)?;
        let written = write_setting(bus, id, register, &bytes);
        // Lock the EEPROM again after a failure too.
        let locked = bus.write(id, register::LOCK, &[1]);
        written?;
        locked.map_err(SetError::StaysOpen)?;
    } else {
        bus.write(id, register.address, &bytes)?;
    }
    Ok(get(bus, id, register)?)
}

fn checked(register: &ServoRegister, value: i32) -> Result<u16, SetError> {
    let (lowest, highest) = register.range;
    match register.memory {
        ServoMemory::ReadOnly => return Err(SetError::ReadOnly(register.name)),
        _ if register.address == register::ID => return Err(SetError::IdNeedsCheck),
        _ => {}
    }
    let in_range = u16::try_from(value).ok().filter(|value| (lowest..=highest).contains(value));
    in_range.ok_or(SetError::OutOfRange { register: *register, value })
}

/// Writes a register of the open EEPROM. A new baud rate acts at once: the servo answers at that rate only.
fn write_setting(
    bus: &mut BusMaster,
    id: u8,
    register: &ServoRegister,
    bytes: &[u8],
) -> Result<(), ServoError> {
    let code = bytes.last().copied().map(usize::from);
    let rate = code.and_then(|code| BAUD_RATES.get(code)).filter(|_| register.address == register::BAUD_RATE);
    let Some(&rate) = rate else { return bus.write(id, register.address, bytes) };
    bus.send_write(id, register.address, bytes)?;
    bus.set_baud(rate)?;
    let found = bus.read(id, register.address, register.width)?;
    if found.values == bytes { Ok(()) } else { Err(ServoError::NotTaken { id, register: register.address }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servo_bench::tests::simulated::{SimulatedServo, bus};

    fn row(name: &str) -> &'static ServoRegister {
        ServoRegister::find(name).expect("a name of the table")
    }

    #[test]
    fn a_setting_is_written_in_the_open_eeprom_and_locked_again() {
        let (mut bus, wire) = bus(vec![SimulatedServo::new(3)]);
        assert_eq!(set(&mut bus, 3, row("max-torque"), 600).map(|set| set.value), Ok(600));
        assert_eq!(get(&mut bus, 3, row("lock")).map(|lock| lock.value), Ok(1));
        let sent = wire.lock().unwrap().sent.clone();
        let writes: Vec<_> =
            sent.iter().filter(|frame| frame[4] == 3).map(|frame| frame[5..7].to_vec()).collect();
        assert_eq!(writes, [vec![48, 0], vec![16, 2], vec![48, 1]]);
        wire.lock().unwrap().servos[0].servo.power_cycle(protocol_core::time::Instant::ZERO);
        assert_eq!(get(&mut bus, 3, row("max-torque")).map(|kept| kept.value), Ok(600));
    }

    #[test]
    fn what_cannot_be_written_is_refused_before_anything_is_sent() {
        let (mut bus, wire) = bus(vec![SimulatedServo::new(3)]);
        assert_eq!(set(&mut bus, 3, row("status"), 0), Err(SetError::ReadOnly("status")));
        assert_eq!(set(&mut bus, 3, row("id"), 4), Err(SetError::IdNeedsCheck));
        for value in [-1, 1001, 70_000] {
            let register = *row("max-torque");
            assert_eq!(set(&mut bus, 3, &register, value), Err(SetError::OutOfRange { register, value }));
        }
        assert_eq!(wire.lock().unwrap().sent.len(), 0);
    }

    #[test]
    fn a_silent_servo_gets_no_write() {
        let (mut bus, wire) = bus(vec![SimulatedServo::new(3)]);
        let refused = set(&mut bus, 4, row("max-torque"), 600);
        assert!(matches!(refused, Err(SetError::Bus(ServoError::NoAnswer { id: 4, .. }))), "{refused:?}");
        assert!(wire.lock().unwrap().sent.iter().all(|frame| frame[4] == 2), "only reads");
    }

    #[test]
    fn a_new_baud_rate_is_that_of_the_bus_from_then_on() {
        let (mut bus, wire) = bus(vec![SimulatedServo::new(3)]);
        assert_eq!(set(&mut bus, 3, row("baud-rate"), 4).map(|set| set.value), Ok(4));
        assert_eq!(wire.lock().unwrap().servos[0].servo.baud(), 115_200);
        assert_eq!(get(&mut bus, 3, row("lock")).map(|lock| lock.value), Ok(1));
    }

    #[test]
    fn all_registers_are_read_with_their_signs() {
        let (mut bus, _) = bus(vec![SimulatedServo::new(3)]);
        let all = get_all(&mut bus, 3).expect("it answers");
        let value =
            |name: &str| all.iter().find(|value| value.register.name == name).map(|value| value.value);
        assert_eq!(
            (value("id"), value("present-position"), value("present-voltage")),
            (Some(3), Some(300), Some(74))
        );
        assert_eq!(row("present-load").decode(&[0x05, 0x1C]), -284);
        assert_eq!(row("present-speed").decode(&[0x80, 0x0A]), -10);
        assert_eq!(row("unload-conditions").meaning(37), "voltage, overheated, overload");
    }
}
