//! How a servo protects itself: overload, heat and a wrong voltage.
//!
//! | alarm | begins | ends |
//! | --- | --- | --- |
//! | overload | the torque was above 80 % of the stall torque for a second | torque is switched off, or power is lost |
//! | heat | the temperature is above register 13 | the temperature is at most register 13 |
//! | voltage | the supply is outside registers 15 to 14 | the supply is within registers 15 to 14 |
//!
//! Each alarm is an error bit in every answer. Register 19 tells which alarms switch the motor off; the factory setting is
//! all three. The torque switch (register 40) keeps its value: when a heat or voltage alarm ends, torque comes back by itself.
//!
//! The torque is the duty less the part that the speed needs. So a fast motion without load is no overload.

use motion_core::servo_bus::frame::error;

use crate::parameters::{OVERLOAD, OVERLOAD_MS};

/// The limits in a servo's registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Limits {
    pub(super) max_celsius: u8,
    pub(super) max_decivolts: u8,
    pub(super) min_decivolts: u8,
    /// The error bits that switch the motor off.
    pub(super) unloading: u8,
}

/// The alarms of a servo.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Protection {
    /// Number of successive steps with an overload.
    overload_steps: u32,
    is_overloaded: bool,
    /// The alarms that switch the motor off.
    unloading: u8,
}

impl Protection {
    /// Is a torque, in 0.1 % of the stall torque, an overload?
    pub(super) const fn is_overload(torque: i16) -> bool {
        torque.unsigned_abs() > OVERLOAD
    }

    /// Records a step in which nothing changes and the torque is no overload.
    pub(super) const fn rest(&mut self) {
        self.overload_steps = 0;
    }

    /// Counts a step with this torque, in 0.1 % of the stall torque.
    pub(super) const fn step(&mut self, torque: i16) {
        self.overload_steps = if Self::is_overload(torque) { self.overload_steps + 1 } else { 0 };
        self.is_overloaded |= self.overload_steps >= OVERLOAD_MS;
    }

    /// Is an overload latched?
    pub(super) const fn is_overloaded(&self) -> bool {
        self.is_overloaded
    }

    /// Latches an overload.
    pub(super) const fn trip(&mut self) {
        self.is_overloaded = true;
    }

    /// Ends a latched overload: torque was switched off, or the servo lost its power.
    pub(super) const fn release(&mut self) {
        self.overload_steps = 0;
        self.is_overloaded = false;
        self.unloading &= !error::OVERLOAD;
    }

    /// The error bits at this temperature and supply voltage.
    pub(super) const fn errors(&self, limits: Limits, celsius: u8, decivolts: u8) -> u8 {
        let is_voltage_wrong = decivolts < limits.min_decivolts || decivolts > limits.max_decivolts;
        let overload = if self.is_overloaded { error::OVERLOAD } else { 0 };
        let heat = if celsius > limits.max_celsius { error::OVERHEAT } else { 0 };
        let voltage = if is_voltage_wrong { error::VOLTAGE } else { 0 };
        overload | heat | voltage
    }

    /// Switches the motor off if one of these error bits demands it, and on otherwise. Returns whether this ended a switch-off.
    pub(super) const fn unload(&mut self, errors: u8, limits: Limits) -> bool {
        let was_unloaded = self.is_unloaded();
        self.unloading = errors & limits.unloading;
        was_unloaded && !self.is_unloaded()
    }

    /// Is the motor switched off?
    pub(super) const fn is_unloaded(&self) -> bool {
        self.unloading != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACTORY: Limits =
        Limits { max_celsius: 80, max_decivolts: 250, min_decivolts: 50, unloading: 0x25 };

    #[test]
    fn an_overload_of_a_second_is_latched() {
        let mut protection = Protection::default();
        (0..999).for_each(|_| protection.step(801));
        protection.step(800);
        (0..999).for_each(|_| protection.step(-801));
        assert_eq!(protection.errors(FACTORY, 25, 74), 0, "800 is no overload");
        protection.step(-801);
        protection.step(0);
        assert_eq!(protection.errors(FACTORY, 25, 74), error::OVERLOAD);
        protection.release();
        assert_eq!(protection.errors(FACTORY, 25, 74), 0);
    }

    #[test]
    fn alarms_depend_on_the_limits() {
        let errors = |celsius, decivolts| Protection::default().errors(FACTORY, celsius, decivolts);
        assert_eq!([errors(80, 50), errors(81, 50), errors(80, 49)], [0, error::OVERHEAT, error::VOLTAGE]);
        assert_eq!([errors(25, 250), errors(25, 251)], [0, error::VOLTAGE]);
        let colder = Limits { max_celsius: 60, ..FACTORY };
        assert_eq!(Protection::default().errors(colder, 61, 74), error::OVERHEAT);
    }

    #[test]
    fn register_19_tells_which_alarms_switch_the_motor_off() {
        for (unloading, bit) in (0..=u8::MAX)
            .flat_map(|mask| [error::VOLTAGE, error::OVERHEAT, error::OVERLOAD].map(|bit| (mask, bit)))
        {
            let limits = Limits { unloading, ..FACTORY };
            let mut protection = Protection::default();
            assert!(!protection.unload(bit, limits));
            assert_eq!(protection.is_unloaded(), unloading & bit != 0);
            assert_eq!(protection.unload(0, limits), unloading & bit != 0, "torque comes back");
            assert!(!protection.is_unloaded());
        }
    }
}
