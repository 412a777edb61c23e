//! The three motor states of register 29 and what each permits (D13).

use protocol_core::registers::map::motor_state;

use crate::servo_bus::Torque;

/// Register 29.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MotorState {
    /// No joint is driven; the motors brake.
    Damping,
    /// Every joint that answers is driven to its target.
    Servo,
    /// No joint is driven; the arm can be moved by hand.
    Forceless,
}

impl MotorState {
    /// The state behind a value of register 29, which holds no other.
    #[must_use]
    pub const fn from_register(value: u8) -> Self {
        match value {
            motor_state::SERVO => Self::Servo,
            motor_state::FORCELESS => Self::Forceless,
            _ => Self::Damping,
        }
    }

    /// What a joint's torque switch is set to, depending on whether the joint may be driven.
    #[must_use]
    pub const fn torque(self, engaged: bool) -> Torque {
        match self {
            Self::Damping => Torque::Damping,
            Self::Servo if engaged => Torque::On,
            Self::Servo | Self::Forceless => Torque::Free,
        }
    }
}
