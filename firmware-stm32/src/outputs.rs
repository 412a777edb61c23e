//! Pump, valve and status LED.

use crate::board;
use crate::gpio::{DigitalOutput, Switch};

/// The devices that the firmware switches.
pub(crate) struct Outputs {
    pub(crate) pump: Switch<DigitalOutput>,
    pub(crate) valve: Switch<DigitalOutput>,
    pub(crate) led: Switch<DigitalOutput>,
}

impl Outputs {
    /// Makes their pins outputs, all off.
    pub(crate) fn open() -> Self {
        Self {
            pump: board::PUMP.into_switch(board::VACUUM_ACTIVE),
            valve: board::VALVE.into_switch(board::VACUUM_ACTIVE),
            led: board::LED.into_switch(board::LED_ACTIVE),
        }
    }
}
