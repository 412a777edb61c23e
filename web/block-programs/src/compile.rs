//! Compiles the tree of a program to instructions.

use crate::code::{Act, Code, LocatedInstruction, MachineInstruction};
use crate::fault::BlockId;
use crate::program::{Expression, ExpressionKind, Program, Statement, StatementKind, UserFunction};
use crate::value::Value;

/// The result of a function that returns no value.
const NO_RESULT: Value = Value::Number(0.0);

pub(crate) fn compile(program: &Program) -> Code {
    let mut compiler = Compiler::default();
    compiler.statements(&program.body);
    compiler.add(MachineInstruction::End, &"".into());
    let functions = program.functions.iter().map(|function| compiler.function(function)).collect();
    Code { instructions: compiler.instructions, functions, globals: program.variables.len() }
}

#[derive(Default)]
struct Compiler {
    instructions: Vec<LocatedInstruction>,
    loops: Vec<Loop>,
}

/// A loop whose body is being compiled.
struct Loop {
    head: usize,
    /// True if the number of remaining iterations is on the stack: a break has to drop this number.
    is_counted: bool,
    /// The instructions that jump to the end of the loop, which is not known yet.
    exits: Vec<usize>,
}

impl Compiler {
    fn add(&mut self, instruction: MachineInstruction, block: &BlockId) {
        self.instructions.push((instruction, block.clone()));
    }

    /// As [`Self::add`]. Returns the index of the instruction.
    fn place(&mut self, instruction: MachineInstruction, block: &BlockId) -> usize {
        self.add(instruction, block);
        self.instructions.len() - 1
    }

    /// Sets the destination of the jump at this index to the next instruction to be added.
    fn land(&mut self, jump: usize) {
        let next = self.instructions.len();
        if let Some((
            MachineInstruction::Jump(to)
            | MachineInstruction::JumpIfFalse(to)
            | MachineInstruction::JumpKeepingIf { to, .. }
            | MachineInstruction::NextRound(to),
            _,
        )) = self.instructions.get_mut(jump)
        {
            *to = next;
        }
    }

    /// Compiles a function. Returns the index of its first instruction.
    fn function(&mut self, function: &UserFunction) -> usize {
        let begin = self.place(MachineInstruction::Begin, &function.block);
        self.statements(&function.body);
        match &function.result {
            Some(result) => self.expression(result),
            None => self.add(MachineInstruction::Push(NO_RESULT), &function.block),
        }
        self.add(MachineInstruction::Return, &function.block);
        begin
    }

    fn statements(&mut self, statements: &[Statement]) {
        statements.iter().for_each(|statement| self.statement(statement));
    }

    fn statement(&mut self, Statement { block, kind }: &Statement) {
        let act = |compiler: &mut Self, act| compiler.add(MachineInstruction::Act(act), block);
        match kind {
            StatementKind::Repeat { times, body } => return self.repeat(block, times, body),
            StatementKind::While { condition, body } => return self.repeat_while(block, condition, body),
            _ => {}
        }
        self.add(MachineInstruction::Begin, block);
        match kind {
            StatementKind::MoveJoint { joint, angle, speed } => {
                self.expressions([angle, speed]);
                act(self, Act::MoveJoint(*joint));
            }
            StatementKind::Pose { angles, seconds } => {
                for number in angles.iter().chain([seconds]) {
                    self.add(MachineInstruction::Push(Value::Number(*number)), block);
                }
                act(self, Act::Pose);
            }
            StatementKind::MoveTip { to, tool, speed } => {
                self.expressions(to.iter().chain([speed]));
                act(self, Act::MoveTip(*tool));
            }
            StatementKind::Line { to, tool, speed } => {
                self.expressions(to.iter().chain([speed]));
                act(self, Act::Line(*tool));
            }
            StatementKind::Grip(is_open) => act(self, Act::Grip(*is_open)),
            StatementKind::Vacuum(is_on) => act(self, Act::Vacuum(*is_on)),
            StatementKind::Wait(seconds) => {
                self.expression(seconds);
                act(self, Act::Wait);
            }
            StatementKind::Set(variable, value) => {
                self.expression(value);
                self.add(MachineInstruction::Store(*variable), block);
            }
            StatementKind::Change(variable, by) => {
                self.add(MachineInstruction::Load(*variable), block);
                self.expression(by);
                self.add(MachineInstruction::Calculate(crate::program::Arithmetic::Add), block);
                self.add(MachineInstruction::Store(*variable), block);
            }
            StatementKind::Call { function, arguments } => {
                self.call(block, *function, arguments);
                self.add(MachineInstruction::Pop, block);
            }
            StatementKind::Return(condition, value) => self.return_if(block, condition, value.as_ref()),
            StatementKind::If { branches, otherwise } => self.branches(block, branches, otherwise),
            StatementKind::Break => self.leave_loop(block),
            StatementKind::Continue => {
                let head = self.loops.last().map_or(0, |inner| inner.head);
                self.add(MachineInstruction::Jump(head), block);
            }
            StatementKind::Repeat { .. } | StatementKind::While { .. } => {}
        }
    }

    fn repeat(&mut self, block: &BlockId, times: &Expression, body: &[Statement]) {
        self.expression(times);
        self.add(MachineInstruction::Count, block);
        let head = self.place(MachineInstruction::Begin, block);
        let exit = self.place(MachineInstruction::NextRound(0), block);
        self.rounds(block, body, Loop { head, is_counted: true, exits: vec![exit] });
    }

    fn repeat_while(&mut self, block: &BlockId, condition: &Expression, body: &[Statement]) {
        let head = self.place(MachineInstruction::Begin, block);
        self.expression(condition);
        let exit = self.place(MachineInstruction::JumpIfFalse(0), block);
        self.rounds(block, body, Loop { head, is_counted: false, exits: vec![exit] });
    }

    fn rounds(&mut self, block: &BlockId, body: &[Statement], inner: Loop) {
        let head = inner.head;
        self.loops.push(inner);
        self.statements(body);
        self.add(MachineInstruction::Jump(head), block);
        let exits = self.loops.pop().map(|inner| inner.exits).unwrap_or_default();
        exits.into_iter().for_each(|exit| self.land(exit));
    }

    fn leave_loop(&mut self, block: &BlockId) {
        if self.loops.last().is_some_and(|inner| inner.is_counted) {
            self.add(MachineInstruction::Pop, block);
        }
        let exit = self.place(MachineInstruction::Jump(0), block);
        if let Some(inner) = self.loops.last_mut() {
            inner.exits.push(exit);
        }
    }

    fn return_if(&mut self, block: &BlockId, condition: &Expression, value: Option<&Expression>) {
        self.expression(condition);
        let over = self.place(MachineInstruction::JumpIfFalse(0), block);
        match value {
            Some(value) => self.expression(value),
            None => self.add(MachineInstruction::Push(NO_RESULT), block),
        }
        self.add(MachineInstruction::Return, block);
        self.land(over);
    }

    fn branches(
        &mut self,
        block: &BlockId,
        branches: &[(Expression, Vec<Statement>)],
        otherwise: &[Statement],
    ) {
        let mut ends = Vec::new();
        for (condition, body) in branches {
            self.expression(condition);
            let next = self.place(MachineInstruction::JumpIfFalse(0), block);
            self.statements(body);
            ends.push(self.place(MachineInstruction::Jump(0), block));
            self.land(next);
        }
        self.statements(otherwise);
        ends.into_iter().for_each(|end| self.land(end));
    }

    fn call(&mut self, block: &BlockId, function: usize, arguments: &[Expression]) {
        self.expressions(arguments);
        self.add(MachineInstruction::Call { function, arguments: arguments.len() }, block);
    }

    fn expressions<'a>(&mut self, expressions: impl IntoIterator<Item = &'a Expression>) {
        expressions.into_iter().for_each(|expression| self.expression(expression));
    }

    fn expression(&mut self, Expression { block, kind }: &Expression) {
        match kind {
            ExpressionKind::Number(number) => {
                self.add(MachineInstruction::Push(Value::Number(*number)), block)
            }
            ExpressionKind::Truth(truth) => self.add(MachineInstruction::Push(Value::Truth(*truth)), block),
            ExpressionKind::Variable(variable) => self.add(MachineInstruction::Load(*variable), block),
            ExpressionKind::Sense(sensor) => self.add(MachineInstruction::Sense(*sensor), block),
            ExpressionKind::Calculate(operation, pair) => {
                self.expressions(pair.iter());
                self.add(MachineInstruction::Calculate(*operation), block);
            }
            ExpressionKind::Compare(comparison, pair) => {
                self.expressions(pair.iter());
                self.add(MachineInstruction::Compare(*comparison), block);
            }
            ExpressionKind::And(pair) => self.choose(block, pair, false),
            ExpressionKind::Or(pair) => self.choose(block, pair, true),
            ExpressionKind::Not(inner) => {
                self.expression(inner);
                self.add(MachineInstruction::Not, block);
            }
            ExpressionKind::Call { function, arguments } => self.call(block, *function, arguments),
        }
    }

    /// Compiles "and" (`truth` false) or "or" (`truth` true). As in Python, the second operand is evaluated only if the first
    /// one does not decide the result.
    fn choose(&mut self, block: &BlockId, [one, other]: &[Expression; 2], truth: bool) {
        self.expression(one);
        let end = self.place(MachineInstruction::JumpKeepingIf { truth, to: 0 }, block);
        self.expression(other);
        self.land(end);
    }
}
