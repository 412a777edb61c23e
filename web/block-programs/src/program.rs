//! The tree of a program, which the parser makes from Blockly's blocks.

use sevenbot::Joint;

use crate::command::{Axis, NamedDirection, Sensor};
use crate::fault::BlockId;

/// A parsed program. [`Interpreter`](crate::Interpreter) runs it, and [`python`](crate::python()) writes it as Python.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// The names of the variables, as the user typed them.
    pub(crate) variables: Vec<String>,
    pub(crate) functions: Vec<UserFunction>,
    pub(crate) body: Vec<Statement>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UserFunction {
    pub(crate) block: BlockId,
    pub(crate) name: String,
    /// The indices of the variables that its parameters hide: Blockly makes a variable for each parameter.
    pub(crate) parameters: Vec<usize>,
    pub(crate) body: Vec<Statement>,
    pub(crate) result: Option<Expression>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Statement {
    pub(crate) block: BlockId,
    pub(crate) kind: StatementKind,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum StatementKind {
    MoveJoint {
        joint: Joint,
        angle: Expression,
        speed: Expression,
    },
    /// Angles in degrees, and the duration of the move in seconds.
    Pose {
        angles: [f64; 7],
        seconds: f64,
    },
    MoveTip {
        to: [Expression; 3],
        tool: NamedDirection,
        speed: Expression,
    },
    Line {
        to: [Expression; 3],
        tool: NamedDirection,
        speed: Expression,
    },
    /// True opens the gripper.
    Grip(bool),
    Vacuum(bool),
    Wait(Expression),
    Repeat {
        times: Expression,
        body: Vec<Statement>,
    },
    While {
        condition: Expression,
        body: Vec<Statement>,
    },
    Break,
    Continue,
    If {
        branches: Vec<(Expression, Vec<Statement>)>,
        otherwise: Vec<Statement>,
    },
    Set(Variable, Expression),
    Change(Variable, Expression),
    Call {
        function: usize,
        arguments: Vec<Expression>,
    },
    /// Returns from the function if the first expression is true. The second one is the result; `None` if the function has none.
    Return(Expression, Option<Expression>),
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Expression {
    pub(crate) block: BlockId,
    pub(crate) kind: ExpressionKind,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ExpressionKind {
    Number(f64),
    Truth(bool),
    Variable(Variable),
    Calculate(Arithmetic, Box<[Expression; 2]>),
    Compare(Comparison, Box<[Expression; 2]>),
    And(Box<[Expression; 2]>),
    Or(Box<[Expression; 2]>),
    Not(Box<Expression>),
    Sense(Sensor),
    Call { function: usize, arguments: Vec<Expression> },
}

/// A variable of the program, or a parameter of the current function, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Variable {
    Global(usize),
    Parameter(usize),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arithmetic {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Remainder,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Comparison {
    Equal,
    NotEqual,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

impl Axis {
    pub(crate) const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];
}
