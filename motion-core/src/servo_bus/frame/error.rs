//! The bits of the error byte in a servo's answers. Register 197 shows the same bits.

pub use protocol_core::registers::map::servo_alarm::{OVERHEAT, OVERLOAD, VOLTAGE};
