//! Pump, valve and status LED.

use super::board;
use super::gpio::{DigitalOutput, Switch};

/// The devices that the firmware switches.
pub struct Outputs {
    /// The vacuum pump, on [`board::PUMP`].
    pub pump: Switch<DigitalOutput>,
    /// The valve that lets air into the cup.
    pub valve: Switch<DigitalOutput>,
    /// The status LED, on [`board::LED`].
    pub led: Switch<DigitalOutput>,
}

impl Outputs {
    /// Makes the pins outputs, at the levels that switch the devices off.
    pub fn open() -> Self {
        Self {
            pump: board::PUMP.into_switch(board::VACUUM_ACTIVE),
            valve: board::VALVE.into_switch(board::VACUUM_ACTIVE),
            led: board::LED.into_switch(board::LED_ACTIVE),
        }
    }
}
