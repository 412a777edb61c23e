//! Why a program ends early.

use block_programs::{BlockId, ProgramError};
use sevenbot::Joint;
use sevenbot::health::MoveFault;

use crate::confirmed::NotTaken;
use crate::movement::PlayFailure;

/// Why a program ends early.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramFailure {
    /// The program is wrong.
    Program(ProgramError),
    /// The arm does not carry it out.
    Arm(PlayFailure),
    /// The tip cannot go there.
    Refused {
        /// The name of the text that says why.
        text: &'static str,
        /// Why, and what is possible instead, in English.
        details: String,
    },
    /// The firmware of the arm does not tell this.
    NotTold,
    /// Joints have other targets than those of the program.
    OtherTargets(Vec<Joint>),
}

impl ProgramFailure {
    /// The block that is wrong; `None` if it is the one that runs.
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

impl From<NotTaken> for ProgramFailure {
    fn from(_: NotTaken) -> Self {
        Self::Arm(PlayFailure::NotTaken)
    }
}

impl From<ProgramError> for ProgramFailure {
    fn from(error: ProgramError) -> Self {
        Self::Program(error)
    }
}
