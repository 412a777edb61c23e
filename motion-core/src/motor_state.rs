//! The three motor states of register 29 ([D13](protocol_core::decisions#d13)).

use protocol_core::registers::map::motor_state;

use crate::servo_bus::Torque;

/// The motor state, the value of register 29.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum MotorState {
    /// No joint is driven; the motors brake.
    Damping,
    /// The joints are driven to their targets.
    Servo,
    /// No joint is driven; the arm can be moved by hand.
    Forceless,
}

impl MotorState {
    /// The state for a value of register 29. Register 29 holds 0, 1 or 2 only.
    #[must_use]
    pub const fn from_register(value: u8) -> Self {
        match value {
            motor_state::SERVO => Self::Servo,
            motor_state::FORCELESS => Self::Forceless,
            _ => Self::Damping,
        }
    }

    /// The torque of every joint; `None` in state 1, where it differs from joint to joint.
    #[must_use]
    pub const fn torque(self) -> Option<Torque> {
        match self {
            Self::Damping => Some(Torque::Damping),
            Self::Forceless => Some(Torque::Free),
            Self::Servo => None,
        }
    }
}
