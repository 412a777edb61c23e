//! The errors of a program: faults that the parser finds, and faults that end the program while it runs.

use std::fmt;
use std::rc::Rc;

/// The identifier that Blockly gave to a block.
pub type BlockId = Rc<str>;

/// A fault, and the block that causes it.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramError {
    /// `None` if the fault concerns the workspace as a whole.
    pub block: Option<BlockId>,
    /// What is wrong. It prints as a sentence in English.
    pub fault: ProgramFault,
}

/// The physical quantity of a number in a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The angle of a joint, in degrees.
    Angle,
    /// The speed of a joint, in degrees per second.
    JointSpeed,
    /// The speed of the tip, in millimetres per second.
    TipSpeed,
    /// A duration, in seconds.
    Time,
}

impl Quantity {
    /// The symbol of the unit, the same in all languages.
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
    /// The text is no workspace of Blockly. Holds the message of the JSON parser.
    NotAWorkspace(String),
    /// The text is longer than 200,000 bytes.
    TooLarge,
    /// Blocks are nested more than 60 deep. Blocks below one another do not count.
    TooDeep,
    /// The block that starts a program is missing or disabled.
    NoStart,
    /// More than one block starts the program.
    SeveralStarts,
    /// The parser does not know this kind of block.
    UnknownBlock(String),
    /// This input of the block is empty, or the block in it is disabled.
    EmptyInput(String),
    /// This field of the block is missing or has an invalid value.
    BadField(String),
    /// No block defines this function.
    UnknownFunction(String),
    /// The block leaves or continues a loop, but is not in one.
    NotInLoop,
    /// The block returns from a function, but is not in one.
    NotInFunction,
    /// The result of a calculation is not finite, for example after a division by zero.
    NoNumber,
    /// A call would open more than [`MOST_CALLS`](crate::MOST_CALLS) calls of functions: the recursion probably has no end.
    TooManyCalls,
    /// A number is out of its range.
    OutOfRange {
        /// The quantity, which determines the unit.
        quantity: Quantity,
        /// The number that the program uses, in the unit of `quantity`.
        value: f64,
        /// The lowest allowed value, in the same unit.
        lowest: f64,
        /// The highest allowed value, in the same unit.
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
    /// The error that shows this fault at a block.
    pub(crate) fn at(self, block: &BlockId) -> ProgramError {
        ProgramError { block: Some(BlockId::clone(block)), fault: self }
    }

    /// The error without a block: the fault concerns the workspace as a whole.
    pub(crate) const fn of_workspace(self) -> ProgramError {
        ProgramError { block: None, fault: self }
    }
}
