//! The registers of a servo by name: where they are, their ranges, and what their values mean.
//!
//! The only table of their names, widths, ranges and units. The addresses that the controller uses are in
//! [`super::register`].

use motion_core::servo_bus::frame::{BAUD_RATES, register};

use super::MAX_ID;

/// Where a register is, and whether it can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoMemory {
    /// Kept without power, and protected by the lock.
    Eeprom,
    /// Reset when the power goes off.
    Ram,
    /// Measured or fixed: it cannot be written.
    ReadOnly,
}

impl ServoMemory {
    /// `EEPROM`, `RAM` or `read only`, for a table.
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
    /// `SCSCL library` or `SCS memory table`, for a table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Library => "SCSCL library",
            Self::MemoryTable => "SCS memory table",
        }
    }
}

/// A row of the register table: one value of a servo, in one or two bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoRegister {
    /// The name in lower case with dashes, such as `min-position`.
    pub name: &'static str,
    /// The address of the first byte.
    pub address: u8,
    /// Bytes, 1 or 2; the high byte is first.
    pub width: u8,
    /// The lowest and highest value that may be written; of a read-only register, those of its raw number.
    pub range: (u16, u16),
    /// The unit; empty for a code or a number.
    pub unit: &'static str,
    /// Where the register is, and whether it can be written.
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

impl ServoRegister {
    /// The register with this name; `None` if there is none.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        SERVO_REGISTERS.iter().find(|row| row.name == name)
    }

    /// The value in these bytes, with its sign.
    pub(super) fn decode(&self, bytes: &[u8]) -> i32 {
        let raw = bytes.iter().fold(0, |value, &byte| value << 8 | i32::from(byte));
        let Some(bit) = self.sign_bit else { return raw };
        let magnitude = raw & ((1 << bit) - 1);
        if raw >> bit & 1 == 1 { -magnitude } else { magnitude }
    }

    /// The bytes of a value in range.
    pub(super) fn encode(&self, value: u16) -> Vec<u8> {
        let bytes = value.to_be_bytes();
        bytes.into_iter().skip(2 - usize::from(self.width.clamp(1, 2))).collect()
    }

    /// What the number means: the baud rate of a code, the state of the lock, the names of error bits; otherwise the unit.
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

const _: () = assert!(MAX_ID == 253, "the range of the id is that of the table");

#[cfg(test)]
mod tests {
    use super::*;

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
}
