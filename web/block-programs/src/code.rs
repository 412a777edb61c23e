//! A program as a list of instructions for a machine with its own stack of values, so that deep recursion in a program cannot
//! overflow the stack of the host.

use sevenbot::Joint;

use crate::command::{NamedDirection, Sensor};
use crate::fault::BlockId;
use crate::program::{Arithmetic, Comparison, Variable};
use crate::value::Value;

/// One instruction of the machine. Its operands are on top of the stack, the last one topmost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum MachineInstruction {
    /// A block begins: the interpreter returns an event, so that its caller decides when to go on.
    Begin,
    Push(Value),
    Load(Variable),
    Store(Variable),
    Calculate(Arithmetic),
    Compare(Comparison),
    Not,
    Pop,
    Jump(usize),
    JumpIfFalse(usize),
    /// If the value on top has this truth, keeps the value and jumps. If not, drops the value.
    JumpKeepingIf {
        truth: bool,
        to: usize,
    },
    /// Rounds the number of iterations towards zero; a negative number becomes 0.
    Count,
    /// If the number of remaining iterations is 0, drops the number and jumps. If not, decrements it.
    NextRound(usize),
    Sense(Sensor),
    Act(Act),
    Call {
        function: usize,
        arguments: usize,
    },
    /// Returns from a function, with the value on top as its result.
    Return,
    End,
}

/// A command whose operands are on the stack. The documentation of each variant names the operands, the topmost last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Act {
    /// Angle in degrees, speed in degrees per second.
    MoveJoint(Joint),
    /// Seven angles in degrees, duration in seconds.
    Pose,
    /// x, y, z in mm, speed in degrees per second.
    MoveTip(NamedDirection),
    /// x, y, z in mm, speed in mm/s.
    Line(NamedDirection),
    Grip(bool),
    Vacuum(bool),
    /// Duration in seconds.
    Wait,
}

/// An instruction and the block that it belongs to.
pub(crate) type LocatedInstruction = (MachineInstruction, BlockId);

/// All instructions of a program: first the body of the program, which ends with [`MachineInstruction::End`], then the functions.
#[derive(Debug, Default)]
pub(crate) struct Code {
    pub(crate) instructions: Vec<LocatedInstruction>,
    /// The index of the first instruction of each function.
    pub(crate) functions: Vec<usize>,
    pub(crate) globals: usize,
}
