//! The faults of an arm, and their names on a command line: `3=missing`, `5=late=20`, `bus=echo`, `supply=off`.
//!
//! | location | faults |
//! | --- | --- |
//! | a joint, 1 to 7 | [`ServoFault`], [`Obstacle`] |
//! | `bus` | `echo` |
//! | `supply` | [`SupplyFault`] |
//! | `flash` | [`FlashFault`] |
//! | `line` | [`LineFault`] |
//! | `arm` | `supported`, `goal-starts-torque` |

use core::fmt::{self, Display, Formatter};
use core::mem::discriminant;
use core::str::FromStr;

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use crate::fault_count::FaultCount;
use crate::faulty_flash::{FlashFault, UnknownFlashFault};
use crate::host_line::{LineFault, UnknownLineFault};
use crate::plant::{Plant, SupplyFault, UnknownSupplyFault};
use crate::servo::{ServoFault, UnknownFault};

mod help;
pub(crate) mod list;
mod obstacle;

pub use help::FAULTS_HELP;
pub use obstacle::{Obstacle, UnknownObstacle};

/// A fault of the simulated arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ArmFault {
    /// A fault of this joint's servo.
    Servo(Joint, ServoFault),
    /// An obstacle of this joint. It is not a fault of the arm.
    Obstacle(Joint, Obstacle),
    /// A fault of the servo bus: the controller receives its own bytes.
    Echo,
    /// A fault of the supply of all servos.
    Supply(SupplyFault),
    /// A fault of the settings storage.
    Flash(FlashFault),
    /// A fault of the host line.
    Line(LineFault),
    /// A stand supports the arm, so that it does not fall. It is not a fault of the arm.
    Supported,
    /// In every servo, a goal switches torque on if the torque switch was not written since the servo's start.
    GoalStartsTorque,
}

/// Where a fault is: the part of its text before the first `=`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FaultLocation {
    /// A joint: its servo, or an obstacle.
    Joint(Joint),
    /// The servo bus.
    Bus,
    /// The supply of the servos.
    Supply,
    /// The settings storage.
    Flash,
    /// The host line.
    Line,
    /// The whole arm.
    Arm,
}

/// Why a text is not a fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnknownArmFault {
    /// The text has no `=`, the part before the first `=` is not a location, or the bus or the arm has no such fault.
    #[error(
        "use JOINT=KIND with a joint from 1 to 7, bus=echo, supply=KIND, flash=KIND, line=KIND, arm=supported or \
         arm=goal-starts-torque"
    )]
    Location,
    /// The part after the joint is not a fault of a servo, and no obstacle.
    #[error("{0}; or an obstacle: wall=DEGREES, push=MILLINEWTON_METRES or thing=DEGREES")]
    Kind(#[from] UnknownFault),
    /// The part after the joint is not an obstacle.
    #[error(transparent)]
    Obstacle(#[from] UnknownObstacle),
    /// The fault is a thing between the claws, which only joint 7 moves, but it names another joint.
    #[error("only joint 7 moves the claws: use 7=thing=DEGREES")]
    NoClaw,
    /// The part after `supply=` is not a fault of the supply.
    #[error(transparent)]
    Supply(#[from] UnknownSupplyFault),
    /// The part after `flash=` is not a fault of the flash.
    #[error(transparent)]
    Flash(#[from] UnknownFlashFault),
    /// The part after `line=` is not a fault of the host line.
    #[error(transparent)]
    Line(#[from] UnknownLineFault),
}

/// The text is not a location of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("use a joint from 1 to 7, bus, supply, flash, line or arm")]
pub struct UnknownLocation;

impl FromStr for FaultLocation {
    type Err = UnknownLocation;

    fn from_str(text: &str) -> Result<Self, UnknownLocation> {
        Ok(match text {
            "bus" => Self::Bus,
            "supply" => Self::Supply,
            "flash" => Self::Flash,
            "line" => Self::Line,
            "arm" => Self::Arm,
            number => Self::Joint(number.parse().ok().and_then(Joint::new).ok_or(UnknownLocation)?),
        })
    }
}

impl Display for FaultLocation {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Joint(joint) => write!(out, "{}", joint.number()),
            Self::Bus => out.write_str("bus"),
            Self::Supply => out.write_str("supply"),
            Self::Flash => out.write_str("flash"),
            Self::Line => out.write_str("line"),
            Self::Arm => out.write_str("arm"),
        }
    }
}

impl FromStr for ArmFault {
    type Err = UnknownArmFault;

    fn from_str(text: &str) -> Result<Self, UnknownArmFault> {
        let (location, kind) = text.split_once('=').ok_or(UnknownArmFault::Location)?;
        Ok(match (location.parse(), kind) {
            (Ok(FaultLocation::Bus), "echo") => Self::Echo,
            (Ok(FaultLocation::Arm), "supported") => Self::Supported,
            (Ok(FaultLocation::Arm), "goal-starts-torque") => Self::GoalStartsTorque,
            (Ok(FaultLocation::Joint(joint)), kind) if Obstacle::is_kind(kind) => {
                let obstacle: Obstacle = kind.parse()?;
                let is_possible = obstacle.is_possible_at(joint);
                is_possible.then_some(Self::Obstacle(joint, obstacle)).ok_or(UnknownArmFault::NoClaw)?
            }
            (Ok(FaultLocation::Joint(joint)), kind) => Self::Servo(joint, kind.parse()?),
            (Ok(FaultLocation::Supply), kind) => Self::Supply(kind.parse()?),
            (Ok(FaultLocation::Flash), kind) => Self::Flash(kind.parse()?),
            (Ok(FaultLocation::Line), kind) => Self::Line(kind.parse()?),
            _ => return Err(UnknownArmFault::Location),
        })
    }
}

impl Display for ArmFault {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Servo(joint, fault) => write!(out, "{}={fault}", joint.number()),
            Self::Obstacle(joint, obstacle) => write!(out, "{}={obstacle}", joint.number()),
            Self::Echo => out.write_str("bus=echo"),
            Self::Supply(fault) => write!(out, "supply={fault}"),
            Self::Flash(fault) => write!(out, "flash={fault}"),
            Self::Line(fault) => write!(out, "line={fault}"),
            Self::Supported => out.write_str("arm=supported"),
            Self::GoalStartsTorque => out.write_str("arm=goal-starts-torque"),
        }
    }
}

impl ArmFault {
    /// The part of the arm that has the fault; for an obstacle, its joint.
    #[must_use]
    pub const fn location(self) -> FaultLocation {
        match self {
            Self::Servo(joint, _) | Self::Obstacle(joint, _) => FaultLocation::Joint(joint),
            Self::Echo => FaultLocation::Bus,
            Self::Supply(_) => FaultLocation::Supply,
            Self::Flash(_) => FaultLocation::Flash,
            Self::Line(_) => FaultLocation::Line,
            Self::Supported | Self::GoalStartsTorque => FaultLocation::Arm,
        }
    }

    /// Does the fault act on the [`Plant`]? [`ArmFault::apply`] ignores all other faults.
    #[must_use]
    pub const fn is_of_plant(self) -> bool {
        !matches!(self, Self::Flash(_) | Self::Line(_))
    }

    /// Does this new fault replace `other`? A servo and the supply have one fault at a time. A joint has one obstacle of each
    /// kind, and the host line one fault of each kind. The flash and the arm can have all their faults at the same time.
    #[must_use]
    pub fn replaces(self, other: Self) -> bool {
        match (self, other) {
            (Self::Flash(new), Self::Flash(old)) => new == old,
            (Self::Obstacle(joint, new), Self::Obstacle(other, old)) => {
                joint == other && discriminant(&new) == discriminant(&old)
            }
            (Self::Line(new), Self::Line(old)) => discriminant(&new) == discriminant(&old),
            (new, old) => new.location() == old.location() && discriminant(&new) == discriminant(&old),
        }
    }

    /// The unit of the fault's [`FaultCount`]. `None`: the effects of the fault are not counted.
    #[must_use]
    pub const fn unit(self) -> Option<&'static str> {
        Some(match self {
            Self::Servo(_, ServoFault::Missing) => "frames",
            Self::Servo(_, ServoFault::Late(_) | ServoFault::Garbled(_)) => "answers",
            Self::Servo(_, ServoFault::Stuck) | Self::Obstacle(..) => "ms",
            Self::Servo(_, ServoFault::Restarting(_)) => "restarts",
            Self::Echo | Self::Line(_) => "bytes",
            Self::Supply(SupplyFault::Dips(_)) => "dips",
            Self::Supply(_) => "frames",
            Self::Flash(FlashFault::Fails) => "writes",
            Self::Flash(FlashFault::Full) | Self::Supported | Self::GoalStartsTorque => return None,
        })
    }

    /// Applies the fault to a plant.
    pub fn apply(self, plant: &mut Plant) {
        match self {
            Self::Servo(joint, fault) => plant.set_fault(joint, Some(fault)),
            Self::Obstacle(joint, obstacle) => obstacle.apply(joint, plant),
            Self::Echo => plant.set_echo(true),
            Self::Supply(fault) => plant.set_supply_fault(Some(fault)),
            Self::Supported => plant.support(true),
            Self::GoalStartsTorque => plant.set_goal_starts_torque(true),
            Self::Flash(_) | Self::Line(_) => {}
        }
    }

    pub(crate) fn remove(self, plant: &mut Plant) {
        match self {
            Self::Servo(joint, _) => plant.set_fault(joint, None),
            Self::Obstacle(joint, obstacle) => obstacle.remove(joint, plant),
            Self::Echo => plant.set_echo(false),
            Self::Supply(_) => plant.set_supply_fault(None),
            Self::Supported => plant.support(false),
            Self::GoalStartsTorque => plant.set_goal_starts_torque(false),
            Self::Flash(_) | Self::Line(_) => {}
        }
    }
}

/// A fault, and how often it took effect so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaultReport {
    /// The fault. Its text is that of a command line, such as `3=missing`.
    pub fault: ArmFault,
    /// When its duration is over. `None`: it has none.
    pub until: Option<Instant>,
    /// How often it took effect. `None` if its effects are not counted.
    pub count: Option<FaultCount>,
}

impl FaultReport {
    /// The time until its duration is over. `None`: it has none.
    #[must_use]
    pub fn remaining(&self, now: Instant) -> Option<Duration> {
        self.until.map(|until| until - now)
    }

    /// Did the fault never take effect? `false` if its effects are not counted.
    #[must_use]
    pub fn had_no_effect(&self) -> bool {
        self.count.is_some_and(|count| count.effects == 0)
    }
}

/// For example `3=garbled=10: 0 of 4 answers: it never took effect`.
impl Display for FaultReport {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.fault)?;
        if let (Some(FaultCount { effects, occasions }), Some(unit)) = (self.count, self.fault.unit()) {
            write!(out, ": {effects} of {occasions} {unit}")?;
        }
        if self.had_no_effect() { out.write_str(": it never took effect") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests;
