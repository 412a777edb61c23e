//! The registers of one servo: settings, commands, measurements.

use motion_core::calibration::angle_from_counts;
use motion_core::servo_bus::Reading;
use motion_core::servo_bus::frame::{BAUD_RATES, error, register};
use protocol_core::registers::Joint;

use super::bus_master::BusMaster;
use super::error::ServoError;

/// The number of registers of the EEPROM, up to the LED conditions.
const SETTINGS: u8 = register::LED_CONDITIONS + 1;
/// The number of registers from the torque switch to the lock.
const ORDERS: u8 = register::LOCK - register::TORQUE_SWITCH + 1;
/// The number of registers from the present position to the moving flag.
const MEASURED: u8 = register::MOVING - register::PRESENT_POSITION + 1;

/// Versions, settings, commands and measurements of one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoInfo {
    /// The id on the servo bus.
    pub id: u8,
    /// Major and minor version of the firmware: 0.0 if the servo's table does not define it.
    pub firmware_version: (u8, u8),
    /// Major and minor version of the servo.
    pub servo_version: (u8, u8),
    /// Register 2: 1 means high byte first, as in SCS servos.
    pub byte_order: u8,
    /// The baud rate; `None` for an undefined code.
    pub baud: Option<u32>,
    /// Does the servo acknowledge writes (register 8)?
    pub acknowledges_writes: bool,
    /// Lowest and highest goal position in counts. If both are 0 the motor turns without end.
    pub position_limits: (u16, u16),
    /// The temperature limit in degrees Celsius.
    pub max_temperature: u8,
    /// Lowest and highest supply voltage in 0.1 V.
    pub voltage_limits: (u8, u8),
    /// The torque limit in 0.1 % of the stall torque.
    pub max_torque: u16,
    /// Error bits that switch the torque off.
    pub unload_conditions: u8,
    /// The code in the torque switch, register 40.
    pub torque_switch: u8,
    /// The goal position in counts.
    pub goal_position: u16,
    /// Is the EEPROM unlocked: is register 48 zero?
    pub is_unlocked: bool,
    /// The measurements; `None` if the position is outside 0 to 1023 counts.
    pub reading: Option<Reading>,
    /// The error bits of the status register and of the answer that held it.
    pub errors: u8,
    /// Does the servo report that it moves (register 66)?
    pub is_moving: bool,
}

impl ServoInfo {
    /// Reads the registers with three questions.
    ///
    /// # Errors
    /// The servo does not answer, or the port failed.
    pub fn read(bus: &mut BusMaster, id: u8) -> Result<Self, ServoError> {
        let settings = RegisterBlock::read(bus, id, 0, SETTINGS)?;
        let orders = RegisterBlock::read(bus, id, register::TORQUE_SWITCH, ORDERS)?;
        let measured = RegisterBlock::read(bus, id, register::PRESENT_POSITION, MEASURED)?;
        let reading = measured.values.get(..usize::from(Reading::REGISTERS));
        Ok(Self {
            id,
            firmware_version: settings.pair(register::FIRMWARE_VERSION),
            servo_version: settings.pair(register::SERVO_VERSION),
            byte_order: settings.byte(register::BYTE_ORDER),
            baud: BAUD_RATES.get(usize::from(settings.byte(register::BAUD_RATE))).copied(),
            acknowledges_writes: settings.byte(register::RESPONSE_LEVEL) != 0,
            position_limits: (settings.word(register::MIN_POSITION), settings.word(register::MAX_POSITION)),
            max_temperature: settings.byte(register::MAX_TEMPERATURE),
            voltage_limits: (settings.byte(register::MIN_VOLTAGE), settings.byte(register::MAX_VOLTAGE)),
            max_torque: settings.word(register::MAX_TORQUE),
            unload_conditions: settings.byte(register::UNLOAD_CONDITIONS),
            torque_switch: orders.byte(register::TORQUE_SWITCH),
            goal_position: orders.word(register::GOAL_POSITION),
            is_unlocked: orders.byte(register::LOCK) == 0,
            reading: reading.and_then(Reading::parse),
            errors: measured.byte(register::STATUS) | measured.errors,
            is_moving: measured.byte(register::MOVING) != 0,
        })
    }

    /// The joint with this id; `None` if the arm has none.
    #[must_use]
    pub const fn joint(&self) -> Option<Joint> {
        Joint::from_index(self.id)
    }

    /// The joint's angle in degrees, without the offset that the arm's controller stores. `None` without a position, or if
    /// no joint has this id.
    #[must_use]
    pub fn degrees(&self) -> Option<f64> {
        let counts = self.reading?.position_counts;
        Some(f64::from(angle_from_counts(self.joint()?, counts, 0).0) / 1e6)
    }

    /// Does the motor turn without end, without a position?
    #[must_use]
    pub const fn turns_endlessly(&self) -> bool {
        matches!(self.position_limits, (0, 0))
    }
}

/// The names of error bits: `voltage, overload`; `none` if no bit is set.
#[must_use]
pub fn error_words(errors: u8) -> String {
    const NAMES: [(u8, &str); 3] =
        [(error::VOLTAGE, "voltage"), (error::OVERHEAT, "overheated"), (error::OVERLOAD, "overload")];
    let known = NAMES.iter().filter(|(bit, _)| errors & bit != 0).map(|(_, name)| (*name).to_owned());
    let named = NAMES.iter().fold(0, |bits, (bit, _)| bits | bit);
    let unknown = (errors & !named != 0).then(|| format!("unknown bits {:#04x}", errors & !named));
    let words: Vec<String> = known.chain(unknown).collect();
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}

/// Consecutive registers from one answer.
struct RegisterBlock {
    first: u8,
    errors: u8,
    values: Vec<u8>,
}

impl RegisterBlock {
    fn read(bus: &mut BusMaster, id: u8, first: u8, count: u8) -> Result<Self, ServoError> {
        let answer = bus.read(id, first, count)?;
        Ok(Self { first, errors: answer.errors, values: answer.values })
    }

    /// The value of a register, which must not be before the block; 0 if it is behind the block.
    fn byte(&self, register: u8) -> u8 {
        let place = usize::from(register.saturating_sub(self.first));
        self.values.get(place).copied().unwrap_or(0)
    }

    fn pair(&self, register: u8) -> (u8, u8) {
        (self.byte(register), self.byte(register + 1))
    }

    fn word(&self, register: u8) -> u16 {
        u16::from_be_bytes([self.byte(register), self.byte(register + 1)])
    }
}
