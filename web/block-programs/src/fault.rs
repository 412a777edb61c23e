//! Why a workspace is no program, or why a program ends early.

use std::fmt;
use std::rc::Rc;

/// The identifier that Blockly gave to a block.
pub type BlockId = Rc<str>;

/// A fault, and the block where it is.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramError {
    /// `None` if it is that of the whole workspace.
    pub block: Option<BlockId>,
    /// What is wrong.
    pub fault: ProgramFault,
}

/// What a number of a block stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Of a joint, in degrees.
    Angle,
    /// Of a joint, in degrees per second.
    JointSpeed,
    /// Of the tip, in millimetres per second.
    TipSpeed,
    /// In seconds.
    Time,
}

impl Quantity {
    /// The unit.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Angle => "°",
            Self::JointSpeed => "°/s",
            Self::TipSpeed => "mm/s",
            Self::Time => "s",
        }
    }
}

/// What is wrong with a program.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramFault {
    /// The text is no workspace of Blockly.
    NotAWorkspace(String),
    /// The text is too long.
    TooLarge,
    /// Blocks are nested too deeply.
    TooDeep,
    /// There is no block with which the program starts.
    NoStart,
    /// There are several blocks with which the program starts.
    SeveralStarts,
    /// This kind of block is not known here.
    UnknownBlock(String),
    /// This input of the block is empty.
    EmptyInput(String),
    /// This field of the block has a value that it cannot have.
    BadField(String),
    /// No block defines this function.
    UnknownFunction(String),
    /// The block ends a loop, and is in none.
    NotInLoop,
    /// The block ends a function, and is in none.
    NotInFunction,
    /// The result is no finite number, as after a division by zero.
    NoNumber,
    /// Functions call each other without an end.
    TooManyCalls,
    /// A number is out of its range.
    OutOfRange {
        /// What it stands for.
        quantity: Quantity,
        /// The number.
        value: f64,
        /// The lowest that is allowed.
        lowest: f64,
        /// The highest that is allowed.
        highest: f64,
    },
}

impl fmt::Display for ProgramFault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAWorkspace(why) => write!(out, "this is no program of blocks: {why}"),
            Self::TooLarge => out.write_str("the program is too large"),
            Self::TooDeep => out.write_str("blocks are nested too deeply"),
            Self::NoStart => out.write_str("the block that starts the program is missing"),
            Self::SeveralStarts => out.write_str("several blocks start the program: keep one"),
            Self::UnknownBlock(kind) => write!(out, "this page does not know blocks of the kind {kind}"),
            Self::EmptyInput(input) => write!(out, "this block needs something in its gap {input}"),
            Self::BadField(field) => write!(out, "this block cannot have the value in its field {field}"),
            Self::UnknownFunction(name) => write!(out, "no block defines the function {name}"),
            Self::NotInLoop => out.write_str("this block ends a loop, and is in none"),
            Self::NotInFunction => out.write_str("this block ends a function, and is in none"),
            Self::NoNumber => {
                out.write_str("the result is no number, or is too large: is something divided by zero?")
            }
            Self::TooManyCalls => out.write_str("the functions call each other without an end"),
            Self::OutOfRange { quantity, value, lowest, highest } => {
                let unit = quantity.unit();
                write!(out, "{value} is out of range: use {lowest} to {highest} {unit}")
            }
        }
    }
}

impl fmt::Display for ProgramError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.fault.fmt(out)
    }
}

impl std::error::Error for ProgramError {}

impl ProgramFault {
    /// At this block.
    pub(crate) fn at(self, block: &BlockId) -> ProgramError {
        ProgramError { block: Some(BlockId::clone(block)), fault: self }
    }

    /// Of the whole workspace.
    pub(crate) const fn of_workspace(self) -> ProgramError {
        ProgramError { block: None, fault: self }
    }
}
