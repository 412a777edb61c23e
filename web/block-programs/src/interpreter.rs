//! Runs a program without input or output: returns its commands and its reads of sensors, one at a time.

use crate::code::{Act, Code, MachineInstruction};
use crate::command::{CLAW, ProgramCommand, Sensor, angle, joint_pace, line_speed, timed_pace, wait};
use crate::compile::compile;
use crate::fault::{BlockId, ProgramError, ProgramFault};
use crate::program::{Program, Variable};
use crate::value::Value;

use sevenbot::cartesian::Vector;

/// The most calls of functions that may be open at the same time.
pub const MOST_CALLS: usize = 200;

/// The next thing that a program does.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramEvent {
    /// This block begins. The program goes on at the next call of [`Interpreter::advance`].
    Begin(BlockId),
    /// The arm has to do this before the program goes on.
    Command(ProgramCommand),
    /// The program reads this sensor. Call [`Interpreter::answer`] before the next [`Interpreter::advance`].
    Sensor(Sensor),
    /// The program is over. Every further call returns this again.
    Over,
}

/// A program that runs.
///
/// ```
/// use block_programs::{Interpreter, Program, ProgramEvent};
///
/// let workspace = r#"{"blocks": {"blocks": [{"type": "arm_start", "id": "a", "next": {"block":
///     {"type": "arm_vacuum", "id": "b", "fields": {"STATE": "ON"}}}}]}}"#;
/// let mut run = Interpreter::new(&Program::parse(workspace)?);
/// assert_eq!(run.advance()?, ProgramEvent::Begin("b".into()));
/// assert_eq!(run.advance()?, ProgramEvent::Command(block_programs::ProgramCommand::Vacuum(true)));
/// assert_eq!(run.advance()?, ProgramEvent::Over);
/// # Ok::<(), block_programs::ProgramError>(())
/// ```
#[derive(Debug)]
pub struct Interpreter {
    code: Code,
    next: usize,
    stack: Vec<Value>,
    globals: Vec<Value>,
    calls: Vec<OpenCall>,
}

/// A call of a function that has not returned yet.
#[derive(Debug)]
struct OpenCall {
    /// The index of the instruction after the call.
    back: usize,
    /// The index of the first argument on the stack.
    base: usize,
}

impl Interpreter {
    /// Creates an interpreter at the beginning of a program. All variables are 0.
    #[must_use]
    pub fn new(program: &Program) -> Self {
        let code = compile(program);
        let globals = vec![Value::Number(0.0); code.globals];
        Self { code, next: 0, stack: Vec::new(), globals, calls: Vec::new() }
    }

    /// Runs the program to its next event. Returns after at most one iteration of a loop or one call of a function. Returns
    /// [`ProgramEvent::Over`] again and again after the end.
    ///
    /// # Errors
    /// A number is out of range or not finite, or too many calls are open. The error names the block.
    pub fn advance(&mut self) -> Result<ProgramEvent, ProgramError> {
        while let Some((instruction, block)) = self.code.instructions.get(self.next).cloned() {
            self.next += 1;
            if let Some(event) = self.execute(instruction, &block).map_err(|fault| fault.at(&block))? {
                return Ok(event);
            }
        }
        Ok(ProgramEvent::Over)
    }

    /// Supplies the value of the sensor that the last [`ProgramEvent::Sensor`] asked for.
    pub fn answer(&mut self, value: Value) {
        self.stack.push(value);
    }

    fn execute(
        &mut self,
        instruction: MachineInstruction,
        block: &BlockId,
    ) -> Result<Option<ProgramEvent>, ProgramFault> {
        match instruction {
            MachineInstruction::Begin => return Ok(Some(ProgramEvent::Begin(block.clone()))),
            MachineInstruction::Sense(sensor) => return Ok(Some(ProgramEvent::Sensor(sensor))),
            MachineInstruction::Act(act) => return Ok(Some(ProgramEvent::Command(self.command(act)?))),
            MachineInstruction::End => {
                self.next = self.code.instructions.len();
                return Ok(Some(ProgramEvent::Over));
            }
            MachineInstruction::Push(value) => self.stack.push(value),
            MachineInstruction::Load(variable) => {
                let value = self.variable(variable).map_or(Value::Number(0.0), |value| *value);
                self.stack.push(value);
            }
            MachineInstruction::Store(variable) => {
                let value = self.pop();
                if let Some(place) = self.variable(variable) {
                    *place = value;
                }
            }
            MachineInstruction::Calculate(operation) => {
                let (other, one) = (self.pop(), self.pop());
                self.stack.push(one.calculate(operation, other)?);
            }
            MachineInstruction::Compare(comparison) => {
                let (other, one) = (self.pop(), self.pop());
                self.stack.push(one.compare(comparison, other));
            }
            MachineInstruction::Not => {
                let value = Value::Truth(!self.pop().truth());
                self.stack.push(value);
            }
            MachineInstruction::Pop => drop(self.pop()),
            _ => self.flow(instruction)?,
        }
        Ok(None)
    }

    /// Carries out jumps, loops, calls and returns.
    fn flow(&mut self, instruction: MachineInstruction) -> Result<(), ProgramFault> {
        match instruction {
            MachineInstruction::Jump(to) => self.next = to,
            MachineInstruction::JumpIfFalse(to) => {
                self.next = if self.pop().truth() { self.next } else { to }
            }
            MachineInstruction::JumpKeepingIf { truth, to } => {
                if self.stack.last().is_some_and(|value| value.truth() == truth) {
                    self.next = to;
                } else {
                    self.pop();
                }
            }
            MachineInstruction::Count => {
                let rounds = self.pop().number().trunc().max(0.0);
                self.stack.push(Value::Number(rounds));
            }
            MachineInstruction::NextRound(to) => {
                let rounds = self.pop().number();
                if rounds > 0.0 {
                    self.stack.push(Value::Number(rounds - 1.0));
                } else {
                    self.next = to;
                }
            }
            MachineInstruction::Call { function, arguments } => self.call(function, arguments)?,
            MachineInstruction::Return => {
                let value = self.pop();
                if let Some(call) = self.calls.pop() {
                    self.stack.truncate(call.base);
                    self.next = call.back;
                }
                self.stack.push(value);
            }
            _ => {}
        }
        Ok(())
    }

    fn call(&mut self, function: usize, arguments: usize) -> Result<(), ProgramFault> {
        if self.calls.len() >= MOST_CALLS {
            return Err(ProgramFault::TooManyCalls);
        }
        let base = self.stack.len().saturating_sub(arguments);
        self.calls.push(OpenCall { back: self.next, base });
        self.next = self.code.functions.get(function).copied().unwrap_or(usize::MAX);
        Ok(())
    }

    fn variable(&mut self, variable: Variable) -> Option<&mut Value> {
        match variable {
            Variable::Global(number) => self.globals.get_mut(number),
            Variable::Parameter(number) => {
                let base = self.calls.last().map_or(0, |call| call.base);
                self.stack.get_mut(base + number)
            }
        }
    }

    /// Takes the value on top of the stack. Compiled code never pops from an empty stack.
    fn pop(&mut self) -> Value {
        self.stack.pop().unwrap_or(Value::Number(0.0))
    }

    /// Takes the `N` numbers on top of the stack, in the order in which they were pushed.
    fn numbers<const N: usize>(&mut self) -> [f64; N] {
        let mut numbers = [0.0; N];
        for number in numbers.iter_mut().rev() {
            *number = self.pop().number();
        }
        numbers
    }

    fn command(&mut self, act: Act) -> Result<ProgramCommand, ProgramFault> {
        Ok(match act {
            Act::MoveJoint(joint) => {
                let [degrees, speed] = self.numbers();
                let mut targets = [None; 7];
                if let Some(target) = targets.get_mut(usize::from(joint.index())) {
                    *target = Some(angle(degrees)?);
                }
                ProgramCommand::Joints { targets, pace: joint_pace(speed)? }
            }
            Act::Pose => {
                let [one, two, three, four, five, six, seven, seconds] = self.numbers();
                let mut targets = [None; 7];
                for (target, degrees) in targets.iter_mut().zip([one, two, three, four, five, six, seven]) {
                    *target = Some(angle(degrees)?);
                }
                ProgramCommand::Joints { targets, pace: timed_pace(seconds)? }
            }
            Act::MoveTip(tool) => {
                let [x, y, z, speed] = self.numbers();
                ProgramCommand::Tip {
                    tip: Vector::new(x, y, z),
                    tool: tool.vector(),
                    pace: joint_pace(speed)?,
                }
            }
            Act::Line(tool) => {
                let [x, y, z, speed] = self.numbers();
                ProgramCommand::Line {
                    tip: Vector::new(x, y, z),
                    tool: tool.vector(),
                    speed: line_speed(speed)?,
                }
            }
            Act::Grip(is_open) => {
                let [open, closed] = CLAW;
                ProgramCommand::Grip { claw: angle(if is_open { open } else { closed })? }
            }
            Act::Vacuum(is_on) => ProgramCommand::Vacuum(is_on),
            Act::Wait => {
                let [seconds] = self.numbers();
                ProgramCommand::Wait(wait(seconds)?)
            }
        })
    }
}

#[cfg(test)]
mod tests;
