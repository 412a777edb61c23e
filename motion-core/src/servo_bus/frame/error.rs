//! The bits of the error byte in a servo's answers.

/// The supply is too low or too high.
pub const VOLTAGE: u8 = 1 << 0;
/// The motor is too hot.
pub const OVERHEAT: u8 = 1 << 2;
/// The motor was overloaded for too long. The bit stays until torque is switched off and on.
pub const OVERLOAD: u8 = 1 << 5;
