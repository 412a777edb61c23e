//! Register addresses, written from `docs/protocol.md`, sections 4 to 6, 9 and 10.

/// Device code, the first register of the ROM.
pub const DEVICE_CODE: u8 = 0;
/// Firmware version in tenths.
pub const FIRMWARE_VERSION: u8 = 1;
/// First of the six bytes of the chip id.
pub const CHIP_ID: u8 = 2;
/// Number that the user gives the arm.
pub const DEVICE_ID: u8 = 11;
/// Code of the baud rate after the next restart.
pub const BAUD_RATE: u8 = 12;
/// First of seven offsets.
pub const OFFSET: u8 = 13;
/// 1: settings are write-protected.
pub const EEPROM_LOCK: u8 = 28;
/// 0 damping, 1 servo, 2 forceless.
pub const MOTOR_STATE: u8 = 29;
/// 0 suction cup, 1 gripper. A write to this RAM register moves no joint, so most tests of writes use it.
pub const EFFECTOR_TYPE: u8 = 30;
/// 1: suck.
pub const VACUUM_PUMP: u8 = 31;
/// First of seven speeds.
pub const SPEED: u8 = 32;
/// First of seven move times.
pub const TIME: u8 = 39;
/// First of seven targets.
pub const TARGET_POSITION: u8 = 46;
/// Reports per second.
pub const FEEDBACK_FREQUENCY: u8 = 53;
/// First of seven measured positions.
pub const PRESENT_POSITION: u8 = 54;
/// Limits of joint angles: bit 0 the linkage, bit 1 the claw.
pub const LIMITS: u8 = 188;
/// First of the sixteen registers of the status block.
pub const STATUS: u8 = 240;
/// Fault bits of the status block; 0: there is no fault.
pub const FAULTS: u8 = 241;
/// Servos that do not reply, bit n-1 for joint n.
pub const MISSING_SERVOS: u8 = 242;
/// 0: the protection is off.
pub const PROTECTION: u8 = 192;
/// Joints that an obstacle keeps from their targets, bit n-1 for joint n (D27).
pub const BLOCKED_JOINTS: u8 = 195;
/// Moving joints, bit n-1 for joint n.
pub const MOVING_JOINTS: u8 = 243;
/// The reason of the last refusal. The next register holds the address of the refused register.
pub const LAST_REFUSAL: u8 = 244;
/// Counter of accepted frames, low byte first.
pub const FRAMES_ACCEPTED: u8 = 246;
/// Counter of frames with an invalid checksum, low byte first.
pub const FRAMES_CORRUPTED: u8 = 248;
/// Counter of refused frames, low byte first.
pub const FRAMES_REFUSED: u8 = 250;
/// Counter of errors on the servo bus, low byte first.
pub const SERVO_BUS_ERRORS: u8 = 252;
/// Supply voltage in tenths of a volt.
pub const SUPPLY_VOLTAGE: u8 = 254;
/// Highest servo temperature in degrees Celsius.
pub const SERVO_TEMPERATURE: u8 = 255;

/// The default targets in degrees, joint 1 first.
pub const STANDARD_POSE: [u8; 7] = [90, 90, 65, 90, 90, 90, 80];
