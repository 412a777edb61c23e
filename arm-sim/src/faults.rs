//! The faults of an arm, and their names on a command line: `3=missing`, `5=late=20`, `bus=echo`, `arm=supported`.

use core::str::FromStr;

use protocol_core::registers::Joint;

use crate::plant::Plant;
use crate::servo::{ServoFault, UnknownFault};

/// A fault of the simulated arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmFault {
    /// Of this joint's servo.
    Servo(Joint, ServoFault),
    /// Of the bus: the controller receives its own bytes.
    Echo,
    /// No fault: a stand supports the arm, so that it does not fall.
    Supported,
    /// Of all servos: after their own start, a goal switches torque on.
    GoalStartsTorque,
}

/// Why a text names no fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnknownArmFault {
    /// The part before the first `=` is not a possible location.
    #[error("use JOINT=KIND with a joint from 1 to 7, bus=echo, arm=supported or arm=goal-starts-torque")]
    Location,
    /// The part after it is no fault of a servo.
    #[error(transparent)]
    Kind(#[from] UnknownFault),
}

impl FromStr for ArmFault {
    type Err = UnknownArmFault;

    fn from_str(text: &str) -> Result<Self, UnknownArmFault> {
        let (location, kind) = text.split_once('=').ok_or(UnknownArmFault::Location)?;
        match (location, kind) {
            ("bus", "echo") => return Ok(Self::Echo),
            ("arm", "supported") => return Ok(Self::Supported),
            ("arm", "goal-starts-torque") => return Ok(Self::GoalStartsTorque),
            _ => {}
        }
        let joint = location.parse().ok().and_then(Joint::new).ok_or(UnknownArmFault::Location)?;
        Ok(Self::Servo(joint, kind.parse()?))
    }
}

impl ArmFault {
    /// Applies the fault to a plant.
    pub fn apply(self, plant: &mut Plant) {
        match self {
            Self::Servo(joint, fault) => plant.set_fault(joint, Some(fault)),
            Self::Echo => plant.set_echo(true),
            Self::Supported => plant.support(true),
            Self::GoalStartsTorque => plant.set_goal_starts_torque(true),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_has_a_location_and_a_kind() {
        assert_eq!("3=missing".parse(), Ok(ArmFault::Servo(Joint::ALL[2], ServoFault::Missing)));
        assert!(matches!("7=late=5".parse(), Ok(ArmFault::Servo(_, ServoFault::Late(_)))));
        assert_eq!("bus=echo".parse(), Ok(ArmFault::Echo));
        assert_eq!("arm=supported".parse(), Ok(ArmFault::Supported));
        assert_eq!("arm=goal-starts-torque".parse(), Ok(ArmFault::GoalStartsTorque));
        for wrong in ["arm=missing", "missing", "0=missing", "8=missing", "x=missing", "bus=missing", ""] {
            assert_eq!(wrong.parse::<ArmFault>(), Err(UnknownArmFault::Location), "{wrong}");
        }
        assert!(matches!("3=echo".parse::<ArmFault>(), Err(UnknownArmFault::Kind(_))));
    }
}
