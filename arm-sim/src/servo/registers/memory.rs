//! The registers of a servo: their number, access and factory settings, from Feetech's memory table of the SCSCL servos.

use motion_core::servo_bus::frame::{BROADCAST, register};

/// Number of registers: 0 to 70. A read of 15 registers from the present position (56) on ends at register 70.
pub(super) const COUNT: usize = 71;
/// The first EEPROM register that a master can write while the lock is open.
const FIRST_SETTING: u8 = register::ID;
/// The first RAM register. Registers below it are EEPROM.
pub(super) const RAM: u8 = register::TORQUE_SWITCH;
/// The highest id of a servo.
pub(super) const MAX_ID: u8 = BROADCAST - 1;

/// All registers of a new servo. Registers that Feetech's table does not define are 0.
pub(super) fn factory_settings(id: u8) -> [u8; COUNT] {
    let mut registers = [0; COUNT];
    for (address, value) in FACTORY.into_iter().chain([(register::ID, id)]) {
        if let Some(slot) = registers.get_mut(usize::from(address)) {
            *slot = value;
        }
    }
    registers
}

/// The high byte of a two-byte value comes first. The versions are assumed.
const FACTORY: [(u8, u8); 15] = [
    (register::FIRMWARE_VERSION, 1),
    (register::BYTE_ORDER, 1),
    (register::SERVO_VERSION, 5),
    (register::SERVO_VERSION + 1, 15),
    (register::RESPONSE_LEVEL, 1),
    (register::MAX_POSITION, 0x03),
    (register::MAX_POSITION + 1, 0xFF),
    (register::MAX_TEMPERATURE, 80),
    (register::MAX_VOLTAGE, 250),
    (register::MIN_VOLTAGE, 50),
    (register::MAX_TORQUE, 0x03),
    (register::MAX_TORQUE + 1, 0xE8),
    (register::UNLOAD_CONDITIONS, 0x25),
    (register::LED_CONDITIONS, 0x25),
    (register::LOCK, 1),
];

/// Can a master write the register? Measurements and versions are read only.
pub(super) const fn is_writable(address: u8, is_locked: bool) -> bool {
    match address {
        FIRST_SETTING..RAM => !is_locked,
        RAM..=register::LOCK => true,
        _ => false,
    }
}
