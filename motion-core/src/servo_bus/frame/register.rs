//! The register addresses of a servo. A value of two bytes has its high byte first. Registers below 40 are EEPROM.

/// Version of the servo's firmware: major, minor. Undefined in Feetech's older tables.
pub const FIRMWARE_VERSION: u8 = 0;
/// Order of the two bytes of a value: 1 is high byte first. Undefined in Feetech's older tables.
pub const BYTE_ORDER: u8 = 2;
/// Version of the servo: major, minor.
pub const SERVO_VERSION: u8 = 3;
/// The id, 0 to 253.
pub const ID: u8 = 5;
/// Code of the baud rate: the index in [`BAUD_RATES`](super::BAUD_RATES).
pub const BAUD_RATE: u8 = 6;
/// 1: a write is acknowledged; 0: only ping and read are answered.
pub const RESPONSE_LEVEL: u8 = 8;
/// The lowest goal position, in counts; two bytes. If this and the highest are 0, the motor turns continuously.
pub const MIN_POSITION: u8 = 9;
/// The highest goal position, in counts; two bytes.
pub const MAX_POSITION: u8 = 11;
/// The highest temperature, in degrees Celsius.
pub const MAX_TEMPERATURE: u8 = 13;
/// The highest supply voltage, in 0.1 V.
pub const MAX_VOLTAGE: u8 = 14;
/// The lowest supply voltage, in 0.1 V.
pub const MIN_VOLTAGE: u8 = 15;
/// The highest torque, in 0.1 % of the stall torque; two bytes.
pub const MAX_TORQUE: u8 = 16;
/// The bits of [`error`](super::error) that switch the torque off.
pub const UNLOAD_CONDITIONS: u8 = 19;
/// The bits of [`error`](super::error) that make the LED blink.
pub const LED_CONDITIONS: u8 = 20;
/// Motor damped, on or free. The codes differ between Feetech's tables.
pub const TORQUE_SWITCH: u8 = 40;
/// The goal position, in counts 0 to 1023; two bytes.
pub const GOAL_POSITION: u8 = 42;
/// The duration of the move, in milliseconds, if the goal speed is 0; two bytes.
pub const GOAL_TIME: u8 = 44;
/// The speed of the move, in counts per second; 0 is the motor's maximum; two bytes.
pub const GOAL_SPEED: u8 = 46;
/// Lock of the servo's own EEPROM: 0 is open, 1 is locked.
pub const LOCK: u8 = 48;
/// The measured position, in counts; two bytes. The eight bytes of a `Reading` begin here.
pub const PRESENT_POSITION: u8 = 56;
/// The measured speed; two bytes, bit 15 is the sign.
pub const PRESENT_SPEED: u8 = 58;
/// The load, in 0.1 %; two bytes, bit 10 is the sign.
pub const PRESENT_LOAD: u8 = 60;
/// The supply voltage, in 0.1 V.
pub const PRESENT_VOLTAGE: u8 = 62;
/// The temperature, in degrees Celsius.
pub const PRESENT_TEMPERATURE: u8 = 63;
/// The bits of [`error`](super::error).
pub const STATUS: u8 = 65;
/// 1 while the servo moves.
pub const MOVING: u8 = 66;
