//! Faults as the command line names them: `3=missing`, `5=late=20`, `bus=echo`, `arm=supported`.

use std::str::FromStr;

use protocol_core::registers::Joint;

use crate::plant::Plant;
use crate::servo::{Fault, UnknownFault};

/// Something that is wrong with the simulated arm from the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultAt {
    /// With the servo of this joint.
    Servo(Joint, Fault),
    /// With the wire: whoever sends hears itself.
    Echo,
    /// None: something supports the arm, so that it does not fall.
    Supported,
    /// With the servos: after a start of their own, a goal switches their torque on.
    GoalStartsTorque,
}

/// Why a `JOINT=KIND` is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoFault {
    /// The part before the first `=` names nothing.
    #[error("use JOINT=KIND with a joint from 1 to 7, bus=echo, arm=supported or arm=goal-starts-torque")]
    Place,
    /// The part behind it is no kind of servo fault.
    #[error(transparent)]
    Kind(#[from] UnknownFault),
}

impl FromStr for FaultAt {
    type Err = NoFault;

    fn from_str(text: &str) -> Result<Self, NoFault> {
        let (place, kind) = text.split_once('=').ok_or(NoFault::Place)?;
        match (place, kind) {
            ("bus", "echo") => return Ok(Self::Echo),
            ("arm", "supported") => return Ok(Self::Supported),
            ("arm", "goal-starts-torque") => return Ok(Self::GoalStartsTorque),
            _ => {}
        }
        let joint = place.parse().ok().and_then(Joint::new).ok_or(NoFault::Place)?;
        Ok(Self::Servo(joint, kind.parse()?))
    }
}

impl FaultAt {
    /// Brings the fault about.
    pub fn befall(self, plant: &mut Plant) {
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
    fn a_fault_has_a_place_and_a_kind() {
        assert_eq!("3=missing".parse(), Ok(FaultAt::Servo(Joint::ALL[2], Fault::Missing)));
        assert!(matches!("7=late=5".parse(), Ok(FaultAt::Servo(_, Fault::Late(_)))));
        assert_eq!("bus=echo".parse(), Ok(FaultAt::Echo));
        assert_eq!("arm=supported".parse(), Ok(FaultAt::Supported));
        assert_eq!("arm=goal-starts-torque".parse(), Ok(FaultAt::GoalStartsTorque));
        for wrong in ["arm=missing", "missing", "0=missing", "8=missing", "x=missing", "bus=missing", ""] {
            assert_eq!(wrong.parse::<FaultAt>(), Err(NoFault::Place), "{wrong}");
        }
        assert!(matches!("3=echo".parse::<FaultAt>(), Err(NoFault::Kind(_))));
    }
}
