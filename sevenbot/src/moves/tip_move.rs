//! Moves of the tip: reads the state of the arm that [`crate::cartesian`] needs.
//!
//! ```text
//!   TipMove: targets of this arm ──▶ JointPath: from where it stands, at its speeds ──▶ Guard
//!   LineStart: its present targets ──▶ StraightLineRequest
//! ```

use protocol_core::registers::Joint;
use protocol_core::registers::map::{PRESENT_POSITION, SPEED, TIME, VACUUM_PUMP};

use super::pace::Pace;
use crate::arm::Arm;
use crate::cartesian::{
    FineTipTarget, Guard, JointPath, PathBreach, StraightLineRequest, TargetResolution, TipTarget, Vector,
};
use crate::error::Error;
use crate::fine_angle::FineAngle;
use crate::fine_state::FineTargets;
use crate::joints::{JointSnapshot, StepBaseError};
use crate::units::{Angle, MoveTime, Speed};
use host_link::Span;

/// The targets that bring the tip to a position, in the finest resolution that the arm takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipMove {
    /// The targets of joints 1 to 5.
    pub targets: FineTargets,
    /// The targets in hundredths of a degree; `None` if the arm takes whole degrees, or only these are legal.
    pub fine: Option<FineTipTarget>,
}

impl TipMove {
    /// The targets for this arm. `tip` and `tool` are the position and the direction for which `target` was computed.
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

/// Why a way of the joints is not checked or not allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GuardedMoveError {
    /// The guard does not allow the way.
    #[error(transparent)]
    Guarded(#[from] PathBreach),
    /// An exchange with the arm failed, before anything was moved.
    #[error(transparent)]
    Exchange(#[from] Error),
}

impl Arm {
    /// Checks the way from the measured positions to these targets, at this pace. A speed or duration that `pace` leaves open
    /// comes from the registers; with a duration, an open speed is the maximum. Joints without a target stay at their measured
    /// positions.
    ///
    /// # Errors
    /// The guard does not allow the way, or an exchange failed.
    pub fn check_way(
        &mut self,
        targets: &FineTargets,
        pace: Pace,
        guard: &Guard,
    ) -> Result<(), GuardedMoveError> {
        let path = self.way_to(targets, pace)?;
        Ok(guard.check_path(&path)?)
    }

    fn way_to(&mut self, targets: &FineTargets, pace: Pace) -> Result<JointPath, Error> {
        let registers = self.read_span(Span::between(&SPEED, &PRESENT_POSITION))?;
        let fine = self.fine_state_if_served()?.map_or([None; 7], |state| state.positions);
        let (mut from, mut to) = ([0.0; 5], [0.0; 5]);
        let (mut speeds, mut times) = ([Speed::MAXIMUM; 5], [MoveTime::NONE; 5]);
        let joints = Joint::ALL.into_iter().zip(fine).zip(targets);
        let ways = from.iter_mut().zip(&mut to).zip(speeds.iter_mut().zip(&mut times));
        for (((joint, fine), target), ((from, to), (speed, time))) in joints.zip(ways) {
            let whole = Angle::from_register(registers.at(PRESENT_POSITION.of(joint)));
            *from = fine.unwrap_or(whole.into()).degrees();
            *to = target.map_or(*from, FineAngle::degrees);
            let (set_speed, set_time) = (registers.at(SPEED.of(joint)), registers.at(TIME.of(joint)));
            let timed = pace.time.map(|_| Speed::MAXIMUM);
            *speed = pace.speed.or(timed).or(Speed::from_steps(set_speed)).unwrap_or(Speed::MAXIMUM);
            *time = pace.time.or(MoveTime::from_steps(set_time)).unwrap_or(MoveTime::NONE);
        }
        Ok(JointPath::at_pace(from, to, speeds, times))
    }
}

/// Where a straight line starts: at the present targets, in the finest resolution that the arm has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineStart {
    /// The targets, joint 1 first.
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
        /// The number of the joint, from 1.
        joint: u8,
        /// Why its target is no base for a step.
        reason: StepBaseError,
    },
    /// An exchange with the arm failed. Nothing was moved.
    #[error(transparent)]
    Exchange(#[from] Error),
}

impl LineStart {
    /// The start for this arm. `joints` are its joints, read a moment ago.
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

    /// A line from here to a tip in millimetres, with a direction of the tool and a speed in millimetres per second. No
    /// guard checks it: set [`StraightLineRequest::guard`].
    #[must_use]
    pub const fn line_to(self, tip: Vector, tool: Vector, speed: f64) -> StraightLineRequest {
        let Self { targets: start, resolution, vacuum } = self;
        StraightLineRequest { start, resolution, vacuum, tip, tool, speed, guard: None }
    }
}
