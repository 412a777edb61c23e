//! Moves of the tip: what [`crate::cartesian`] needs to know of the arm.

use protocol_core::registers::Joint;
use protocol_core::registers::map::VACUUM_PUMP;

use crate::arm::Arm;
use crate::cartesian::{FineTipTarget, StraightLineRequest, TargetResolution, TipTarget, Vector};
use crate::error::Error;
use crate::fine_angle::FineAngle;
use crate::fine_state::FineTargets;
use crate::joints::{JointSnapshot, StepBaseError};
use crate::span::Span;
use crate::units::Angle;

/// The targets that bring the tip to a position, as exact as an arm takes them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipMove {
    /// The targets of joints 1 to 5.
    pub targets: FineTargets,
    /// The targets in hundredths of a degree; `None` if the arm takes whole degrees, or only these are legal.
    pub fine: Option<FineTipTarget>,
}

impl TipMove {
    /// The targets for this arm. `tip` and `tool` are those of `target`.
    ///
    /// # Errors
    /// An exchange failed.
    pub fn of(arm: &mut Arm, target: &TipTarget, tip: Vector, tool: Vector) -> Result<Self, Error> {
        let fine = if arm.has_extended_block()? { target.in_hundredths(tip, tool) } else { None };
        let whole = target.degrees.map(|degrees| Angle::from_register(degrees).into());
        let [t1, t2, t3, t4, t5] = fine.map_or(whole, |fine| fine.angles).map(Some);
        Ok(Self { targets: [t1, t2, t3, t4, t5, None, None], fine })
    }
}

/// Where a straight line starts: the present targets, as exact as the arm has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineStart {
    /// The targets of all joints.
    pub targets: [FineAngle; 7],
    /// The resolution of the arm's targets.
    pub resolution: TargetResolution,
    /// Does the vacuum pump run?
    pub vacuum: bool,
}

/// Why the start of a straight line is unknown.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineStartError {
    /// The target of a joint is no base for a step.
    #[error("the start of the line is not known: joint {joint}: {reason}; nothing was moved")]
    Unknown {
        /// The number of the joint.
        joint: u8,
        /// The reason.
        reason: StepBaseError,
    },
    /// An exchange failed.
    #[error(transparent)]
    Exchange(#[from] Error),
}

impl LineStart {
    /// The start for this arm, with its joints as just read.
    ///
    /// # Errors
    /// The target of a joint is unknown, or an exchange failed.
    pub fn of(arm: &mut Arm, joints: &JointSnapshot) -> Result<Self, LineStartError> {
        let mut whole = [FineAngle::from(Angle::from_register(0)); 7];
        for (angle, joint) in whole.iter_mut().zip(Joint::ALL) {
            let base = joints.step_base(joint);
            let base = base.map_err(|reason| LineStartError::Unknown { joint: joint.number(), reason })?;
            *angle = Angle::from_register(base).into();
        }
        let (resolution, targets) = match arm.has_extended_block()? {
            true => (TargetResolution::Hundredths, arm.fine_targets()?),
            false => (TargetResolution::Degrees, whole),
        };
        let vacuum = arm.read_span(Span::of(&VACUUM_PUMP))?.byte(&VACUUM_PUMP) != 0;
        Ok(Self { targets, resolution, vacuum })
    }

    /// A line from here to a tip in millimetres, with a direction of the tool and a speed in millimetres per second.
    #[must_use]
    pub const fn line_to(self, tip: Vector, tool: Vector, speed: f64) -> StraightLineRequest {
        let Self { targets: start, resolution, vacuum } = self;
        StraightLineRequest { start, resolution, vacuum, tip, tool, speed }
    }
}
