//! The three motor states of register 29 (D13).

use protocol_core::registers::map::motor_state;

use crate::servo_bus::Torque;

/// Register 29.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MotorState {
    /// No joint is driven; the motors brake.
    Damping,
    /// Every joint whose servo answers is driven to its target.
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

    /// The torque of a joint; `None` leaves its switch unchanged. In the servo state a joint that is not driven yet
    /// keeps its torque, because its servo may be holding it (D12).
    #[must_use]
    pub const fn torque(self, is_driven: bool) -> Option<Torque> {
        match self {
            Self::Damping => Some(Torque::Damping),
            Self::Forceless => Some(Torque::Free),
            Self::Servo if is_driven => Some(Torque::On),
            Self::Servo => None,
        }
    }
}
