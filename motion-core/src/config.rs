//! The configuration of a controller: the properties of the board and of the arm.

use protocol_core::time::Duration;

use crate::servo_bus::TorqueCodes;

/// The properties of the board and of the arm.
#[derive(Clone, Copy, Debug)]
pub struct Config {
    /// The chip id, most significant byte first ([D8](protocol_core::decisions#d8)).
    pub chip_id: [u8; 6],
    /// Fault bits known at start: reset cause, clock (`protocol_core::registers::map::fault`).
    pub faults: u8,
    /// The baud rate of the servo bus, in bits per second.
    pub servo_baud: u32,
    /// How long a servo may take to answer, from the last byte sent to the last byte received.
    pub servo_timeout: Duration,
    /// The pause on the servo bus between the last byte, received or sent, and the next frame. A servo needs some
    /// microseconds after its last stop bit to release the line.
    pub guard_time: Duration,
    /// The code table of the servos' torque switch (their register 40).
    pub torque_codes: TorqueCodes,
}
