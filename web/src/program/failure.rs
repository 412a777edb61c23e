//! The reasons for which a program ends early.

use block_programs::{BlockId, ProgramError};
use sevenbot::Joint;
use sevenbot::health::MoveFault;

use crate::confirmed::Unconfirmed;
use crate::movement::PlayFailure;

/// Why a program ends early.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramFailure {
    /// The program itself has a fault, such as a number out of range.
    Program(ProgramError),
    /// The arm does not carry out the program, or something interrupts it.
    Arm(PlayFailure),
    /// The tip cannot go to a point or along a line.
    Refused {
        /// The name of the text that gives the reason in the language of the page.
        text: &'static str,
        /// The reason in English, and what is possible instead, if that is known.
        details: String,
    },
    /// The firmware of the arm does not provide a value that the program needs, or a joint was not measured.
    NotTold,
    /// These joints have other targets than the program has written: something else moves them.
    OtherTargets(Vec<Joint>),
}

impl ProgramFailure {
    /// The block with the fault; `None` if the failure concerns the block that runs.
    #[must_use]
    pub fn block(&self) -> Option<&BlockId> {
        match self {
            Self::Program(error) => error.block.as_ref(),
            _ => None,
        }
    }
}

impl From<MoveFault> for ProgramFailure {
    fn from(fault: MoveFault) -> Self {
        Self::Arm(PlayFailure::Arm(fault))
    }
}

impl From<Unconfirmed> for ProgramFailure {
    fn from(_: Unconfirmed) -> Self {
        Self::Arm(PlayFailure::NotTaken)
    }
}

impl From<ProgramError> for ProgramFailure {
    fn from(error: ProgramError) -> Self {
        Self::Program(error)
    }
}
