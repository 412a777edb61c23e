//! Why a move does not start, or does not reach its end.

use std::time::Duration;

use crate::approach::StartTooFar;
use crate::arm::Arm;
use crate::checked_write::{NotTaken, ServerReason, WriteError};
use crate::error::Error;
use crate::health::{MoveCheckError, Problem, sentences};
use crate::hold::HoldError;
use crate::register_text::{joints, motor_state_name};
use crate::stream::StreamError;
use protocol_core::registers::Joint;

/// Why a move does not start, or does not reach its end.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MoveError {
    /// [`Observer::goes_on`](super::Observer::goes_on) returned `false`. A player has made the arm hold. After another call the
    /// arm may still be moving.
    #[error("interrupted")]
    Interrupted,
    /// This program was suspended for so long that the movement ended. The arm has stopped.
    #[error("this program paused for {:.1} s, so the movement ended: the arm has stopped on its way", time.as_secs_f64())]
    Paused {
        /// How late the program was.
        time: Duration,
    },
    /// The motors do not drive the joints.
    #[error("the arm's motors are in state {state}, {}", motor_state_name(*state))]
    NotDriven {
        /// The value of register 29.
        state: u8,
    },
    /// The arm does not carry out the move, for these reasons. [`ProblemKind::remedy`] says what to do.
    ///
    /// [`ProblemKind::remedy`]: crate::health::ProblemKind::remedy
    #[error("{}", sentences(.0))]
    Problems(Vec<Problem>),
    /// The arm did not take these values.
    #[error(transparent)]
    NotTaken(#[from] NotTaken),
    /// The arm may be moving: it is unknown whether it took the values, or it did not take those that hold it. Holds the reason.
    #[error("the arm may still be moving: {0}")]
    MayMove(#[source] WriteError),
    /// The set-points of these joints still move.
    #[error("still moving after {} s: {}", after.as_secs(), joints(*bits))]
    StillMoving {
        /// Bit 0 is joint 1.
        bits: u8,
        /// How long the call waited for them.
        after: Duration,
    },
    /// Joints are away from their targets after they settled, or had their time to settle.
    #[error(
        "the arm did not reach the pose: {}{}{}",
        away_text(away),
        missing_text(*missing),
        retargeted_text(*retargeted)
    )]
    NotReached {
        /// Joint, position and target in degrees.
        away: Vec<(Joint, u8, u8)>,
        /// The joints whose servo does not answer; bit 0 is joint 1.
        missing: u8,
        /// The joints that have another target by now; bit 0 is joint 1. Another program wrote it, or the arm did, for example
        /// when a servo answered again elsewhere ([D12](protocol_core::decisions#d12)).
        retargeted: u8,
    },
    /// The arm was ordered to hold, but has got other targets since.
    #[error("the arm does not hold: another program has sent it elsewhere")]
    OtherTargets,
    /// The arm was ordered to hold, but something drags joints away from their targets.
    #[error("the arm does not hold: {}", away_text(away))]
    NotHeld {
        /// Joint, position and target in degrees.
        away: Vec<(Joint, u8, u8)>,
    },
    /// Another program stopped the arm through the server that both use, or ended this program's stream.
    #[error("{}", ServerReason::Stopped)]
    StoppedByAnother,
    /// The arm answers, but its reports have ended.
    #[error("the arm has stopped reporting its positions: was it switched off and on?")]
    ReportsStopped,
    /// The first point of a stream or a recording is too far away. No joint was moved towards it.
    #[error(transparent)]
    StartTooFar(#[from] StartTooFar),
    /// The arm's firmware takes no stream of set-points.
    #[error(transparent)]
    Stream(StreamError),
    /// An exchange with the arm failed.
    #[error(transparent)]
    Exchange(#[from] Error),
}

impl From<StreamError> for MoveError {
    fn from(error: StreamError) -> Self {
        match error {
            StreamError::Exchange(error) => Self::Exchange(error),
            StreamError::NotTaken(not_taken) => Self::NotTaken(not_taken),
            other @ StreamError::NoExtendedBlock => Self::Stream(other),
        }
    }
}

impl From<MoveCheckError> for MoveError {
    fn from(error: MoveCheckError) -> Self {
        match error {
            MoveCheckError::Problems(problems) => Self::Problems(problems),
            MoveCheckError::NotDriven { state } => Self::NotDriven { state },
            MoveCheckError::StoppedByAnother => Self::StoppedByAnother,
            MoveCheckError::Exchange(error) => Self::Exchange(error),
        }
    }
}

impl From<HoldError> for MoveError {
    fn from(HoldError(error): HoldError) -> Self {
        Self::MayMove(error)
    }
}

impl From<WriteError> for MoveError {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::NotTaken(not_taken) => Self::NotTaken(not_taken),
            WriteError::Exchange(error) => Self::Exchange(error),
        }
    }
}

impl MoveError {
    /// The failure of a write to registers that move the arm.
    pub(super) fn of_motion(error: WriteError) -> Self {
        if error.is_uncertain() { Self::MayMove(error) } else { error.into() }
    }
}

impl Arm {
    /// As [`Arm::write_checked`], for registers that move the arm or let it go.
    ///
    /// # Errors
    /// [`MoveError::NotTaken`] if the arm refused the values. [`MoveError::MayMove`] if it is unknown whether it took them.
    pub fn write_motion(&mut self, address: u8, values: &[u8]) -> Result<(), MoveError> {
        self.write_checked(address, values).map_err(MoveError::of_motion)
    }
}

/// A failure that may be the end of the connection.
pub trait ConnectionLost {
    /// May the connection be lost, so that the arm takes no more commands?
    fn is_connection_lost(&self) -> bool;
}

impl ConnectionLost for MoveError {
    fn is_connection_lost(&self) -> bool {
        matches!(self, Self::Exchange(_) | Self::MayMove(_))
    }
}

fn away_text(away: &[(Joint, u8, u8)]) -> String {
    let words =
        away.iter().map(|(joint, is, goal)| format!("joint {} is at {is}°, not {goal}°", joint.number()));
    words.collect::<Vec<_>>().join(", ")
}

fn retargeted_text(retargeted: u8) -> String {
    match retargeted {
        0 => String::new(),
        bits => {
            format!("; a stop, another program or a fault of a servo gave {} another target", joints(bits))
        }
    }
}

fn missing_text(missing: u8) -> String {
    if missing == 0 { String::new() } else { format!("; {} not answering", joints(missing)) }
}
