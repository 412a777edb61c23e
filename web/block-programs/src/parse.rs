//! Parses blocks to the tree of a program. This file knows the kinds of blocks, their inputs and their fields.

use std::collections::HashMap;

use sevenbot::Joint;

use crate::command::{Axis, NamedDirection, Sensor};
use crate::fault::{ProgramError, ProgramFault};
use crate::json::{BlocklyBlock, BlocklyWorkspace};
use crate::program::{
    Arithmetic, Comparison, Expression, ExpressionKind, Program, Statement, StatementKind, UserFunction,
    Variable,
};

/// The kind of the block that starts a program.
const START: &str = "arm_start";
/// The kinds of the blocks that define a function: without a result, and with one.
const FUNCTIONS: [&str; 2] = ["procedures_defnoreturn", GIVES_VALUE];
const GIVES_VALUE: &str = "procedures_defreturn";
/// The deepest nesting of blocks. It bounds the stack of the recursive parser.
const DEEPEST: usize = 60;

const AXES: [(&str, Axis); 3] = [("X", Axis::X), ("Y", Axis::Y), ("Z", Axis::Z)];
const DIRECTIONS: [(&str, NamedDirection); 5] = [
    ("DOWN", NamedDirection::Down),
    ("FORWARD", NamedDirection::Forward),
    ("LEFT", NamedDirection::Left),
    ("RIGHT", NamedDirection::Right),
    ("UP", NamedDirection::Up),
];
const ARITHMETIC: [(&str, Arithmetic); 5] = [
    ("ADD", Arithmetic::Add),
    ("MINUS", Arithmetic::Subtract),
    ("MULTIPLY", Arithmetic::Multiply),
    ("DIVIDE", Arithmetic::Divide),
    ("POWER", Arithmetic::Power),
];
const COMPARISONS: [(&str, Comparison); 6] = [
    ("EQ", Comparison::Equal),
    ("NEQ", Comparison::NotEqual),
    ("LT", Comparison::Less),
    ("LTE", Comparison::LessOrEqual),
    ("GT", Comparison::Greater),
    ("GTE", Comparison::GreaterOrEqual),
];

impl Program {
    /// Parses the JSON text of what Blockly's `serialization.workspaces.save` returns.
    ///
    /// # Errors
    /// The text is no valid program. The error names the block, if one causes it.
    pub fn parse(workspace: &str) -> Result<Self, ProgramError> {
        program(workspace)
    }
}

/// Parses a workspace. Ignores disabled blocks, and blocks that are neither below the start block nor part of a function.
fn program(text: &str) -> Result<Program, ProgramError> {
    let workspace = BlocklyWorkspace::of(text)?;
    let blocks: Vec<_> = workspace.top_blocks()?.into_iter().filter(BlocklyBlock::is_enabled).collect();
    let mut starts = blocks.iter().filter(|block| block.kind == START);
    let start = starts.next().ok_or_else(|| ProgramFault::NoStart.of_workspace())?;
    if let Some(second) = starts.next() {
        return Err(second.fault(ProgramFault::SeveralStarts));
    }
    let is_function = |block: &&BlocklyBlock<'_>| FUNCTIONS.contains(&block.kind.as_str());
    let functions: Vec<_> = blocks.iter().filter(is_function).collect();
    let mut names = HashMap::new();
    for (number, block) in functions.iter().enumerate() {
        let known = KnownFunction { number, parameters: parameters(block)?.len() };
        names.insert(block.text("NAME")?.to_owned(), known);
    }
    let ids = workspace.variables.iter().enumerate();
    let globals = ids.map(|(number, variable)| (variable.id.clone(), Variable::Global(number))).collect();
    let scope = Scope { variables: globals, functions: &names, function: None, loops: 0, depth: 0 };
    Ok(Program {
        body: scope.statements(start.next()?)?,
        functions: functions.into_iter().map(|block| scope.function(block)).collect::<Result<_, _>>()?,
        variables: workspace.variables.iter().map(|variable| variable.name.clone()).collect(),
    })
}

/// A function that blocks may call.
struct KnownFunction {
    number: usize,
    parameters: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum FunctionKind {
    WithValue,
    WithoutValue,
}

impl FunctionKind {
    fn of(block: &BlocklyBlock<'_>) -> Self {
        if block.kind == GIVES_VALUE { Self::WithValue } else { Self::WithoutValue }
    }
}

/// The position of a block in the program, and the names that are visible there.
#[derive(Clone)]
struct Scope<'a> {
    /// The visible variables and parameters, by their identifiers.
    variables: HashMap<String, Variable>,
    /// All functions of the program, by their names.
    functions: &'a HashMap<String, KnownFunction>,
    /// The kind of the function that contains the block; `None` in the body of the program.
    function: Option<FunctionKind>,
    loops: usize,
    depth: usize,
}

impl Scope<'_> {
    /// The scope within a block, one level deeper.
    ///
    /// # Errors
    /// The block is nested too deeply.
    fn within(&self, block: &BlocklyBlock<'_>) -> Result<Self, ProgramError> {
        if self.depth >= DEEPEST {
            return Err(block.fault(ProgramFault::TooDeep));
        }
        Ok(Self { depth: self.depth + 1, ..self.clone() })
    }

    fn function(&self, block: &BlocklyBlock<'_>) -> Result<UserFunction, ProgramError> {
        let kind = FunctionKind::of(block);
        let mut scope = Self { function: Some(kind), ..self.within(block)? };
        let mut hidden = Vec::new();
        for id in parameters(block)? {
            let Some(Variable::Global(number)) = self.variables.get(id) else {
                return Err(block.bad_field("params"));
            };
            scope.variables.insert(id.to_owned(), Variable::Parameter(hidden.len()));
            hidden.push(*number);
        }
        let result = (kind == FunctionKind::WithValue).then(|| scope.input(block, "RETURN")).transpose()?;
        Ok(UserFunction {
            block: block.id.0.clone(),
            name: block.text("NAME")?.to_owned(),
            parameters: hidden,
            body: scope.statements(block.input("STACK")?)?,
            result,
        })
    }

    /// Parses a block and all blocks below it. Skips disabled blocks.
    fn statements(&self, first: Option<BlocklyBlock<'_>>) -> Result<Vec<Statement>, ProgramError> {
        let (mut statements, mut next) = (Vec::new(), first);
        while let Some(block) = next {
            if block.is_enabled() {
                statements.push(Statement { block: block.id.0.clone(), kind: self.statement(&block)? });
            }
            next = block.next()?;
        }
        Ok(statements)
    }

    fn statement(&self, block: &BlocklyBlock<'_>) -> Result<StatementKind, ProgramError> {
        let input = |name| self.input(block, name);
        Ok(match block.kind.as_str() {
            "arm_move_joint" => StatementKind::MoveJoint {
                joint: joint(block)?,
                angle: input("ANGLE")?,
                speed: input("SPEED")?,
            },
            "arm_pose" => StatementKind::Pose { angles: pose(block)?, seconds: block.number("SECONDS")? },
            "arm_move_tip" => StatementKind::MoveTip {
                to: self.point(block)?,
                tool: block.choice("TOOL", &DIRECTIONS)?,
                speed: input("SPEED")?,
            },
            "arm_line" => StatementKind::Line {
                to: self.point(block)?,
                tool: block.choice("TOOL", &DIRECTIONS)?,
                speed: input("SPEED")?,
            },
            "arm_grip" => StatementKind::Grip(block.choice("STATE", &[("OPEN", true), ("CLOSE", false)])?),
            "arm_vacuum" => StatementKind::Vacuum(block.choice("STATE", &[("ON", true), ("OFF", false)])?),
            "arm_wait" => StatementKind::Wait(input("SECONDS")?),
            "variables_set" => StatementKind::Set(self.variable(block)?, input("VALUE")?),
            "math_change" => StatementKind::Change(self.variable(block)?, input("DELTA")?),
            "procedures_callnoreturn" => {
                let (function, arguments) = self.call(block)?;
                StatementKind::Call { function, arguments }
            }
            _ => self.flow(block)?,
        })
    }

    /// Parses a block that changes the order of the blocks: a loop, a branch, a break or a return.
    fn flow(&self, block: &BlocklyBlock<'_>) -> Result<StatementKind, ProgramError> {
        Ok(match block.kind.as_str() {
            "controls_repeat_ext" => {
                StatementKind::Repeat { times: self.input(block, "TIMES")?, body: self.repeated(block)? }
            }
            "controls_whileUntil" => {
                let is_until = block.choice("MODE", &[("WHILE", false), ("UNTIL", true)])?;
                let condition = self.input(block, "BOOL")?;
                let condition = if is_until { negated(condition) } else { condition };
                StatementKind::While { condition, body: self.repeated(block)? }
            }
            "controls_flow_statements" if self.loops == 0 => return Err(block.fault(ProgramFault::NotInLoop)),
            "controls_flow_statements" => {
                match block.choice("FLOW", &[("BREAK", true), ("CONTINUE", false)])? {
                    true => StatementKind::Break,
                    false => StatementKind::Continue,
                }
            }
            "controls_if" => self.branches(block)?,
            "procedures_ifreturn" => {
                let kind = self.function.ok_or_else(|| block.fault(ProgramFault::NotInFunction))?;
                let value =
                    (kind == FunctionKind::WithValue).then(|| self.input(block, "VALUE")).transpose()?;
                StatementKind::Return(self.input(block, "CONDITION")?, value)
            }
            kind => return Err(block.fault(ProgramFault::UnknownBlock(kind.to_owned()))),
        })
    }

    fn repeated(&self, block: &BlocklyBlock<'_>) -> Result<Vec<Statement>, ProgramError> {
        let scope = Self { loops: self.loops + 1, ..self.within(block)? };
        scope.statements(block.input("DO")?)
    }

    fn branches(&self, block: &BlocklyBlock<'_>) -> Result<StatementKind, ProgramError> {
        let scope = self.within(block)?;
        let more = block.extra.get("elseIfCount").and_then(serde_json::Value::as_u64).unwrap_or(0);
        let branch = |number: u64| {
            let condition = self.input(block, &format!("IF{number}"))?;
            Ok((condition, scope.statements(block.input(&format!("DO{number}"))?)?))
        };
        Ok(StatementKind::If {
            branches: (0..=more).map(branch).collect::<Result<_, _>>()?,
            otherwise: scope.statements(block.input("ELSE")?)?,
        })
    }

    fn expression(&self, block: &BlocklyBlock<'_>) -> Result<Expression, ProgramError> {
        let pair = |one, other| {
            Ok::<_, ProgramError>(Box::new([self.input(block, one)?, self.input(block, other)?]))
        };
        let kind = match block.kind.as_str() {
            "math_number" => ExpressionKind::Number(block.number("NUM")?),
            "logic_boolean" => {
                ExpressionKind::Truth(block.choice("BOOL", &[("TRUE", true), ("FALSE", false)])?)
            }
            "variables_get" => ExpressionKind::Variable(self.variable(block)?),
            "math_arithmetic" => ExpressionKind::Calculate(block.choice("OP", &ARITHMETIC)?, pair("A", "B")?),
            "math_modulo" => ExpressionKind::Calculate(Arithmetic::Remainder, pair("DIVIDEND", "DIVISOR")?),
            "logic_compare" => ExpressionKind::Compare(block.choice("OP", &COMPARISONS)?, pair("A", "B")?),
            "logic_operation" => match block.choice("OP", &[("AND", true), ("OR", false)])? {
                true => ExpressionKind::And(pair("A", "B")?),
                false => ExpressionKind::Or(pair("A", "B")?),
            },
            "logic_negate" => ExpressionKind::Not(Box::new(self.input(block, "BOOL")?)),
            "procedures_callreturn" => {
                let (function, arguments) = self.call(block)?;
                ExpressionKind::Call { function, arguments }
            }
            _ => ExpressionKind::Sense(sensor(block)?),
        };
        Ok(Expression { block: block.id.0.clone(), kind })
    }

    fn call(&self, block: &BlocklyBlock<'_>) -> Result<(usize, Vec<Expression>), ProgramError> {
        let name = block.extra.get("name").and_then(serde_json::Value::as_str).unwrap_or_default();
        let unknown = || block.fault(ProgramFault::UnknownFunction(name.to_owned()));
        let function = self.functions.get(name).ok_or_else(unknown)?;
        let argument = |number| self.input(block, &format!("ARG{number}"));
        Ok((function.number, (0..function.parameters).map(argument).collect::<Result<_, _>>()?))
    }

    fn point(&self, block: &BlocklyBlock<'_>) -> Result<[Expression; 3], ProgramError> {
        Ok([self.input(block, "X")?, self.input(block, "Y")?, self.input(block, "Z")?])
    }

    /// Parses the expression in an input. An empty input is an error.
    fn input(&self, block: &BlocklyBlock<'_>, name: &str) -> Result<Expression, ProgramError> {
        let inner =
            block.input(name)?.ok_or_else(|| block.fault(ProgramFault::EmptyInput(name.to_owned())))?;
        self.within(&inner)?.expression(&inner)
    }

    fn variable(&self, block: &BlocklyBlock<'_>) -> Result<Variable, ProgramError> {
        self.variables.get(block.variable("VAR")?).copied().ok_or_else(|| block.bad_field("VAR"))
    }
}

/// The identifiers of a function's parameters.
fn parameters<'a>(block: &'a BlocklyBlock<'_>) -> Result<Vec<&'a str>, ProgramError> {
    let list = block.extra.get("params").and_then(serde_json::Value::as_array).into_iter().flatten();
    let id = |parameter: &'a serde_json::Value| parameter.get("id").and_then(serde_json::Value::as_str);
    list.map(|parameter| id(parameter).ok_or_else(|| block.bad_field("params"))).collect()
}

fn negated(condition: Expression) -> Expression {
    Expression { block: condition.block.clone(), kind: ExpressionKind::Not(Box::new(condition)) }
}

fn sensor(block: &BlocklyBlock<'_>) -> Result<Sensor, ProgramError> {
    Ok(match block.kind.as_str() {
        "arm_angle" => Sensor::Angle(joint(block)?),
        "arm_tip" => Sensor::Tip(block.choice("AXIS", &AXES)?),
        "arm_load" => Sensor::Load(joint(block)?),
        "arm_blocked" => Sensor::Blocked(joint(block)?),
        "arm_gripping" => Sensor::Gripping,
        kind => return Err(block.fault(ProgramFault::UnknownBlock(kind.to_owned()))),
    })
}

fn joint(block: &BlocklyBlock<'_>) -> Result<Joint, ProgramError> {
    let number = block.text("JOINT")?.parse().ok();
    number.and_then(Joint::new).ok_or_else(|| block.bad_field("JOINT"))
}

fn pose(block: &BlocklyBlock<'_>) -> Result<[f64; 7], ProgramError> {
    let mut angles = [0.0; 7];
    for (number, angle) in (1..).zip(&mut angles) {
        *angle = block.number(&format!("J{number}"))?;
    }
    Ok(angles)
}
