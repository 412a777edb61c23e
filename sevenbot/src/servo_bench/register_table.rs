//! The registers of a servo by name: read, write with a check of the range, and show.
//!
//! The only table of their names, widths, ranges and units. The addresses that the controller uses are
//! [`super::register`].

use motion_core::servo_bus::frame::{BAUD_RATES, register};

use super::MAX_ID;
use super::bus_master::BusMaster;
use super::error::ServoError;

/// Where a register is, and who may write it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoMemory {
    /// Kept without power, and protected by the lock.
    Eeprom,
    /// Set back when the power goes.
    Ram,
    /// Measured or fixed: it cannot be written.
    ReadOnly,
}

impl ServoMemory {
    /// A word for a table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Eeprom => "EEPROM",
            Self::Ram => "RAM",
            Self::ReadOnly => "read only",
        }
    }
}

/// Where a row of the table comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowSource {
    /// Feetech's library for SCSCL servos names the register, and the simulated servo has it.
    Library,
    /// Only Feetech's memory table of the SCS series names it. Servos with older firmware may not have it.
    MemoryTable,
}

impl RowSource {
    /// A word for a table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Library => "SCSCL library",
            Self::MemoryTable => "SCS memory table",
        }
    }
}

/// One register of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoRegister {
    /// The name, as in Feetech's table, in lower case with dashes.
    pub name: &'static str,
    /// The first byte.
    pub address: u8,
    /// Bytes, 1 or 2; the high byte is first.
    pub width: u8,
    /// The lowest and highest value.
    pub range: (u16, u16),
    /// The unit; empty for a code or a number.
    pub unit: &'static str,
    /// Where it is.
    pub memory: ServoMemory,
    /// The bit that is the sign of the value, if it has one.
    pub sign_bit: Option<u8>,
    /// May a write turn the motor?
    pub may_move: bool,
    /// Where this row comes from.
    pub source: RowSource,
}

const fn eeprom(name: &'static str, address: u8, range: (u16, u16), unit: &'static str) -> ServoRegister {
    ServoRegister {
        name,
        address,
        width: 1,
        range,
        unit,
        memory: ServoMemory::Eeprom,
        sign_bit: None,
        may_move: false,
        source: RowSource::Library,
    }
}

const fn ram(name: &'static str, address: u8, range: (u16, u16), unit: &'static str) -> ServoRegister {
    ServoRegister { memory: ServoMemory::Ram, ..eeprom(name, address, range, unit) }
}

const fn measured(name: &'static str, address: u8, range: (u16, u16), unit: &'static str) -> ServoRegister {
    ServoRegister { memory: ServoMemory::ReadOnly, ..eeprom(name, address, range, unit) }
}

impl ServoRegister {
    const fn word(self) -> Self {
        Self { width: 2, ..self }
    }

    const fn moving(self) -> Self {
        Self { may_move: true, ..self }
    }

    const fn signed_by(self, bit: u8) -> Self {
        Self { sign_bit: Some(bit), ..self }
    }

    const fn of_table(self) -> Self {
        Self { source: RowSource::MemoryTable, ..self }
    }
}

/// All registers, in ascending order.
pub const SERVO_REGISTERS: [ServoRegister; 38] = [
    measured("firmware-major", register::FIRMWARE_VERSION, (0, 255), "").of_table(),
    measured("firmware-minor", register::FIRMWARE_VERSION + 1, (0, 255), "").of_table(),
    measured("byte-order", register::BYTE_ORDER, (0, 255), "").of_table(),
    measured("servo-major", register::SERVO_VERSION, (0, 255), ""),
    measured("servo-minor", register::SERVO_VERSION + 1, (0, 255), ""),
    eeprom("id", register::ID, (0, 253), ""),
    eeprom("baud-rate", register::BAUD_RATE, (0, 7), ""),
    eeprom("return-delay", 7, (0, 254), "2 us").of_table(),
    eeprom("response-level", register::RESPONSE_LEVEL, (0, 1), "").of_table(),
    eeprom("min-position", register::MIN_POSITION, (0, 1023), "counts").word().moving(),
    eeprom("max-position", register::MAX_POSITION, (0, 1023), "counts").word().moving(),
    eeprom("max-temperature", register::MAX_TEMPERATURE, (0, 100), "°C").of_table(),
    eeprom("max-voltage", register::MAX_VOLTAGE, (0, 254), "0.1 V").of_table(),
    eeprom("min-voltage", register::MIN_VOLTAGE, (0, 254), "0.1 V").of_table(),
    eeprom("max-torque", register::MAX_TORQUE, (0, 1000), "0.1 % of stall").word().of_table(),
    eeprom("phase", 18, (0, 254), "").of_table(),
    eeprom("unload-conditions", register::UNLOAD_CONDITIONS, (0, 254), "error bits").of_table(),
    eeprom("led-conditions", register::LED_CONDITIONS, (0, 254), "error bits").of_table(),
    eeprom("p-gain", 21, (0, 254), "").of_table(),
    eeprom("d-gain", 22, (0, 254), "").of_table(),
    eeprom("i-gain", 23, (0, 254), "").of_table(),
    eeprom("min-start-force", 24, (0, 1000), "0.1 % of stall").word().of_table(),
    eeprom("cw-dead-zone", 26, (0, 32), "counts"),
    eeprom("ccw-dead-zone", 27, (0, 32), "counts"),
    eeprom("protective-torque", 37, (0, 100), "% of stall").of_table(),
    eeprom("protection-time", 38, (0, 254), "40 ms").of_table(),
    ram("torque-switch", register::TORQUE_SWITCH, (0, 2), "").moving(),
    ram("goal-position", register::GOAL_POSITION, (0, 1023), "counts").word().moving(),
    ram("goal-time", register::GOAL_TIME, (0, 9999), "ms").word().moving(),
    ram("goal-speed", register::GOAL_SPEED, (0, 1000), "counts/s").word().moving(),
    ram("lock", register::LOCK, (0, 1), ""),
    measured("present-position", register::PRESENT_POSITION, (0, u16::MAX), "counts").word(),
    measured("present-speed", register::PRESENT_SPEED, (0, u16::MAX), "counts/s").word().signed_by(15),
    measured("present-load", register::PRESENT_LOAD, (0, u16::MAX), "0.1 % of stall").word().signed_by(10),
    measured("present-voltage", register::PRESENT_VOLTAGE, (0, 255), "0.1 V"),
    measured("present-temperature", register::PRESENT_TEMPERATURE, (0, 255), "°C"),
    measured("status", register::STATUS, (0, 255), "error bits").of_table(),
    measured("moving", register::MOVING, (0, 1), ""),
];

/// The value of a register of one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoValue {
    /// The register.
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
        /// The register.
        register: ServoRegister,
        /// The value.
        value: i32,
    },
    /// An id is set by another function, which looks for a second servo with that id. Nothing was sent.
    #[error("an id is set by `set-id`, which checks that no other servo has it")]
    IdNeedsCheck,
    /// The EEPROM cannot be opened. Nothing else was written.
    #[error("the servo's EEPROM stays locked: {0}")]
    StaysLocked(ServoError),
    /// The value was written, but the EEPROM cannot be locked again.
    #[error("the value was written, but the servo's EEPROM was not locked again: {0}")]
    StaysOpen(ServoError),
    /// An exchange failed, or the servo did not take the value.
    #[error(transparent)]
    Bus(#[from] ServoError),
}

impl ServoRegister {
    /// The register with this name; `None` if there is none.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        SERVO_REGISTERS.iter().find(|row| row.name == name)
    }

    /// The value in these bytes, with its sign.
    fn decode(&self, bytes: &[u8]) -> i32 {
        let raw = bytes.iter().fold(0, |value, &byte| value << 8 | i32::from(byte));
        let Some(bit) = self.sign_bit else { return raw };
        let magnitude = raw & ((1 << bit) - 1);
        if raw >> bit & 1 == 1 { -magnitude } else { magnitude }
    }

    /// The bytes of a value in range.
    fn encode(&self, value: u16) -> Vec<u8> {
        let bytes = value.to_be_bytes();
        bytes.into_iter().skip(2 - usize::from(self.width.clamp(1, 2))).collect()
    }

    /// The value as text, if the number alone says little: the baud rate of a code.
    #[must_use]
    pub fn meaning(&self, value: i32) -> String {
        match self.address {
            register::BAUD_RATE => {
                let rate = usize::try_from(value).ok().and_then(|code| BAUD_RATES.get(code));
                rate.map_or_else(String::new, |rate| format!("{rate} baud"))
            }
            register::LOCK => (if value == 0 { "open" } else { "locked" }).to_owned(),
            register::STATUS | register::UNLOAD_CONDITIONS | register::LED_CONDITIONS => {
                u8::try_from(value).map_or_else(|_| String::new(), super::servo_info::error_words)
            }
            _ => self.unit.to_owned(),
        }
    }
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
/// After a new baud rate the bus has that rate, too.
///
/// # Errors
/// Each variant of [`SetError`] tells the state of the servo.
pub fn set(
    bus: &mut BusMaster,
    id: u8,
    register: &ServoRegister,
    value: i32,
) -> Result<ServoValue, SetError> {
    let bytes = register.encode(checked(register, value)?);
    if register.memory == ServoMemory::Eeprom {
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

const _: () = assert!(MAX_ID == 253, "the range of the id is that of the table");

#[cfg(test)]
mod tests {
    use super::super::tests::simulated::{SimulatedServo, bus};
    use super::*;

    fn row(name: &str) -> &'static ServoRegister {
        ServoRegister::find(name).expect("a name of the table")
    }

    #[test]
    fn the_table_has_no_overlap_and_no_name_twice() {
        for pair in SERVO_REGISTERS.windows(2) {
            assert!(pair[0].address + pair[0].width <= pair[1].address, "{pair:?}");
            assert!(pair[0].range.0 <= pair[0].range.1);
        }
        let mut names: Vec<_> = SERVO_REGISTERS.iter().map(|row| row.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), SERVO_REGISTERS.len());
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
