//! A program as a list of instructions for a machine with a stack of values. So a running program needs no stack of its host.

use sevenbot::Joint;

use crate::command::{Sensor, Tool};
use crate::fault::BlockId;
use crate::program::{Arithmetic, Comparison, Variable};
use crate::value::Value;

/// One step of the machine. What it takes is on top of the stack, the last one topmost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Step {
    /// A block begins: the machine lets its host decide when to go on.
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
    /// Keeps the value if it jumps, and drops it if not.
    JumpKeepingIf {
        truth: bool,
        to: usize,
    },
    /// Makes the value a whole count of rounds.
    Count,
    /// Takes one off the count, or drops it and jumps if none is left.
    NextRound(usize),
    Sense(Sensor),
    Act(Act),
    Call {
        function: usize,
        arguments: usize,
    },
    /// Ends a function with the value on top.
    Return,
    /// Ends the program.
    End,
}

/// A command whose numbers are on the stack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Act {
    /// Angle, speed.
    MoveJoint(Joint),
    /// Seven angles, seconds.
    Pose,
    /// x, y, z, speed.
    MoveTip(Tool),
    /// x, y, z, speed.
    Line(Tool),
    Grip(bool),
    Vacuum(bool),
    /// Seconds.
    Wait,
}

/// A step and the block that it belongs to.
pub(crate) type Instruction = (Step, BlockId);

/// All steps of a program. Those of its body are the first.
#[derive(Debug, Default)]
pub(crate) struct Code {
    pub(crate) instructions: Vec<Instruction>,
    /// Where the functions begin.
    pub(crate) functions: Vec<usize>,
    pub(crate) globals: usize,
}
