//! Writes a program as Python, for the package `sevenbot`.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Write;

use sevenbot::Joint;

use crate::command::{Axis, CLAW, NamedDirection, Sensor};
use crate::names::Names;
use crate::program::{
    Arithmetic, Comparison, Expression, ExpressionKind, Program, Statement, StatementKind, UserFunction,
    Variable,
};

/// The precedence of Python's operators: a higher one binds tighter. `WHOLE` never needs brackets.
mod binding {
    pub(super) const OR: u8 = 1;
    pub(super) const AND: u8 = 2;
    pub(super) const NOT: u8 = 3;
    pub(super) const COMPARISON: u8 = 4;
    pub(super) const SUM: u8 = 5;
    pub(super) const PRODUCT: u8 = 6;
    pub(super) const SIGN: u8 = 7;
    pub(super) const POWER: u8 = 8;
    pub(super) const WHOLE: u8 = 9;
}

/// Writes a program as Python. The Python program takes the name of a port as its argument. Without an argument, it uses the
/// only connected arm.
///
/// ```
/// let workspace = r#"{"blocks": {"blocks": [{"type": "arm_start", "id": "a", "next": {"block":
///     {"type": "arm_vacuum", "id": "b", "fields": {"STATE": "ON"}}}}]}}"#;
/// let python = block_programs::python(&block_programs::Program::parse(workspace)?);
/// assert!(python.ends_with("as arm:\n    arm.set(\"vacuum-pump\", 1)\n"));
/// # Ok::<(), block_programs::ProgramError>(())
/// ```
#[must_use]
pub fn python(program: &Program) -> String {
    let mut names = Names::new();
    let globals: Vec<_> = program.variables.iter().map(|name| names.give(name)).collect();
    let functions: Vec<_> = program.functions.iter().map(|function| names.give(&function.name)).collect();
    let used = RefCell::default();
    let writer = Writer { globals: &globals, functions: &functions, parameters: &[], used: &used };
    let mut defined = String::new();
    for (function, name) in program.functions.iter().zip(&functions) {
        Writer { parameters: &function.parameters, ..writer }.function(&mut defined, function, name);
    }
    let mut body = String::new();
    line(&mut body, 0, "with sevenbot.Arm(*sys.argv[1:2]) as arm:");
    writer.body(&mut body, 1, &program.body);
    let used = used.take();
    let variables: String =
        used.iter().filter_map(|&number| globals.get(number)).map(|name| format!("{name} = 0\n")).collect();
    let variables = if variables.is_empty() { variables } else { format!("\n{variables}") };
    let gap = if defined.is_empty() { "\n" } else { "\n\n" };
    format!("import sys\n\nimport sevenbot\n{variables}{defined}{gap}{body}")
}

fn line(text: &mut String, depth: usize, content: &str) {
    // Writing to a `String` cannot fail.
    let _ = writeln!(text, "{:indent$}{content}", "", indent = 4 * depth);
}

/// Writes a part of the program, with the names that are visible there.
#[derive(Clone, Copy)]
struct Writer<'a> {
    globals: &'a [String],
    functions: &'a [String],
    /// The variables that the parameters of the current function hide. Blockly gives a parameter the name of its variable.
    parameters: &'a [usize],
    /// Collects the variables that the program uses: only these are defined.
    used: &'a RefCell<BTreeSet<usize>>,
}

impl Writer<'_> {
    fn function(&self, text: &mut String, function: &UserFunction, name: &str) {
        text.push_str("\n\n");
        line(text, 0, &format!("def {name}({}):", self.names(self.parameters).join(", ")));
        let mut set = BTreeSet::new();
        globals_set_in(&function.body, &mut set);
        if !set.is_empty() {
            let set: Vec<_> = set.into_iter().collect();
            line(text, 1, &format!("global {}", self.names(&set).join(", ")));
        }
        match &function.result {
            Some(result) => {
                function.body.iter().for_each(|statement| self.statement(text, 1, statement));
                line(text, 1, &format!("return {}", self.plain(result)));
            }
            None => self.body(text, 1, &function.body),
        }
    }

    fn body(&self, text: &mut String, depth: usize, body: &[Statement]) {
        if body.is_empty() {
            line(text, depth, "pass");
        }
        body.iter().for_each(|statement| self.statement(text, depth, statement));
    }

    fn statement(&self, text: &mut String, depth: usize, statement: &Statement) {
        match &statement.kind {
            StatementKind::Repeat { times, body } => {
                let times = match times.kind {
                    ExpressionKind::Number(number) => format!("{}", number.trunc()),
                    _ => format!("int({})", self.plain(times)),
                };
                line(text, depth, &format!("for _ in range({times}):"));
                self.body(text, depth + 1, body);
            }
            StatementKind::While { condition, body } => {
                line(text, depth, &format!("while {}:", self.plain(condition)));
                self.body(text, depth + 1, body);
            }
            StatementKind::If { branches, otherwise } => {
                for ((condition, body), word) in
                    branches.iter().zip(std::iter::once("if").chain(std::iter::repeat("elif")))
                {
                    line(text, depth, &format!("{word} {}:", self.plain(condition)));
                    self.body(text, depth + 1, body);
                }
                if !otherwise.is_empty() {
                    line(text, depth, "else:");
                    self.body(text, depth + 1, otherwise);
                }
            }
            StatementKind::Return(condition, value) => {
                line(text, depth, &format!("if {}:", self.plain(condition)));
                let value = value.as_ref().map(|value| format!(" {}", self.plain(value))).unwrap_or_default();
                line(text, depth + 1, &format!("return{value}"));
            }
            StatementKind::Grip(is_open) => {
                let [open, closed] = CLAW;
                line(text, depth, "arm.set(\"effector-type\", 1)");
                let angle = if *is_open { open } else { closed };
                line(text, depth, &format!("arm.pose({})", targets(Joint::ALL[6], &number(angle))));
            }
            simple => line(text, depth, &self.simple(simple)),
        }
    }

    /// The text of a statement that needs only one line.
    fn simple(&self, kind: &StatementKind) -> String {
        match kind {
            StatementKind::MoveJoint { joint, angle, speed } => {
                format!("arm.pose({}, speed={})", targets(*joint, &self.plain(angle)), self.plain(speed))
            }
            StatementKind::Pose { angles, seconds } => {
                format!("arm.pose({}, duration={})", angles.map(number).join(", "), number(*seconds))
            }
            StatementKind::MoveTip { to, tool, speed } => self.move_to(to, *tool, "", speed),
            StatementKind::Line { to, tool, speed } => self.move_to(to, *tool, "straight=True, ", speed),
            StatementKind::Vacuum(is_on) => format!("arm.set(\"vacuum-pump\", {})", u8::from(*is_on)),
            StatementKind::Wait(seconds) => format!("arm.sleep({})", self.plain(seconds)),
            StatementKind::Set(variable, value) => {
                format!("{} = {}", self.name(*variable), self.plain(value))
            }
            StatementKind::Change(variable, by) => format!("{} += {}", self.name(*variable), self.plain(by)),
            StatementKind::Call { function, arguments } => self.call(*function, arguments),
            StatementKind::Break => "break".to_owned(),
            _ => "continue".to_owned(),
        }
    }

    fn move_to(
        &self,
        to: &[Expression; 3],
        tool: NamedDirection,
        straight: &str,
        speed: &Expression,
    ) -> String {
        let [x, y, z] = [&to[0], &to[1], &to[2]].map(|part| self.plain(part));
        let tool = match tool {
            NamedDirection::Down => String::new(),
            other => format!("tool=({}), ", other.direction().map(|part| part.to_string()).join(", ")),
        };
        format!("arm.move_to({x}, {y}, {z}, {tool}{straight}speed={})", self.plain(speed))
    }

    fn call(&self, function: usize, arguments: &[Expression]) -> String {
        let arguments: Vec<_> = arguments.iter().map(|argument| self.plain(argument)).collect();
        let name = self.functions.get(function).map_or("", String::as_str);
        format!("{name}({})", arguments.join(", "))
    }

    fn names(&self, variables: &[usize]) -> Vec<&str> {
        variables.iter().filter_map(|&number| self.globals.get(number)).map(String::as_str).collect()
    }

    fn name(&self, variable: Variable) -> &str {
        let number = match variable {
            Variable::Global(number) => {
                self.used.borrow_mut().insert(number);
                Some(number)
            }
            Variable::Parameter(number) => self.parameters.get(number).copied(),
        };
        number.and_then(|number| self.globals.get(number)).map_or("", String::as_str)
    }

    /// The text of an expression at a place where no expression needs brackets.
    fn plain(&self, expression: &Expression) -> String {
        self.expression(expression).0
    }

    /// The text of an operand, in brackets if its precedence is below `least`.
    fn bound(&self, expression: &Expression, least: u8) -> String {
        let (text, binding) = self.expression(expression);
        if binding >= least { text } else { format!("({text})") }
    }

    /// The text of an expression, and its precedence.
    fn expression(&self, expression: &Expression) -> (String, u8) {
        let pair = |pair: &[Expression; 2], word: &str, binding: u8, [left, right]: [u8; 2]| {
            let text = format!("{} {word} {}", self.bound(&pair[0], left), self.bound(&pair[1], right));
            (text, binding)
        };
        match &expression.kind {
            ExpressionKind::Number(value) if *value < 0.0 => (number(*value), binding::SIGN),
            ExpressionKind::Number(value) => (number(*value), binding::WHOLE),
            ExpressionKind::Truth(true) => ("True".to_owned(), binding::WHOLE),
            ExpressionKind::Truth(false) => ("False".to_owned(), binding::WHOLE),
            ExpressionKind::Variable(variable) => (self.name(*variable).to_owned(), binding::WHOLE),
            ExpressionKind::Call { function, arguments } => (self.call(*function, arguments), binding::WHOLE),
            ExpressionKind::Sense(sensor) => sense(*sensor),
            ExpressionKind::Not(inner) => (format!("not {}", self.bound(inner, binding::NOT)), binding::NOT),
            ExpressionKind::And(parts) => pair(parts, "and", binding::AND, [binding::AND, binding::NOT]),
            ExpressionKind::Or(parts) => pair(parts, "or", binding::OR, [binding::OR, binding::AND]),
            // A comparison of a comparison needs brackets: Python chains `a < b < c` as `a < b and b < c`.
            ExpressionKind::Compare(how, parts) => {
                pair(parts, compared(*how), binding::COMPARISON, [binding::SUM; 2])
            }
            ExpressionKind::Calculate(operation, parts) => {
                let (word, own, sides) = calculated(*operation);
                pair(parts, word, own, sides)
            }
        }
    }
}

fn number(value: f64) -> String {
    format!("{value}")
}

/// The seven arguments of `pose` that move only this joint.
fn targets(joint: Joint, angle: &str) -> String {
    Joint::ALL.map(|other| if other == joint { angle } else { "None" }).join(", ")
}

fn sense(sensor: Sensor) -> (String, u8) {
    let index = |joint: Joint| joint.index();
    match sensor {
        Sensor::Angle(joint) => (format!("arm.angles[{}]", index(joint)), binding::WHOLE),
        Sensor::Tip(axis) => {
            let place = Axis::ALL.into_iter().position(|other| other == axis).unwrap_or(0);
            (format!("arm.where().tip[{place}]"), binding::WHOLE)
        }
        Sensor::Load(joint) => (format!("arm.observe().loads[{}]", index(joint)), binding::WHOLE),
        Sensor::Blocked(joint) => {
            (format!("{} in arm.status().blocked", joint.number()), binding::COMPARISON)
        }
        Sensor::Gripping => {
            ("arm.status().joints[6].state == \"holds something\"".to_owned(), binding::COMPARISON)
        }
    }
}

const fn compared(comparison: Comparison) -> &'static str {
    match comparison {
        Comparison::Equal => "==",
        Comparison::NotEqual => "!=",
        Comparison::Less => "<",
        Comparison::LessOrEqual => "<=",
        Comparison::Greater => ">",
        Comparison::GreaterOrEqual => ">=",
    }
}

/// The operator, its precedence, and the lowest precedences at which its left and right operand need no brackets.
const fn calculated(operation: Arithmetic) -> (&'static str, u8, [u8; 2]) {
    use binding::{POWER, PRODUCT, SIGN, SUM, WHOLE};
    match operation {
        Arithmetic::Add => ("+", SUM, [SUM, PRODUCT]),
        Arithmetic::Subtract => ("-", SUM, [SUM, PRODUCT]),
        Arithmetic::Multiply => ("*", PRODUCT, [PRODUCT, SIGN]),
        Arithmetic::Divide => ("/", PRODUCT, [PRODUCT, SIGN]),
        Arithmetic::Remainder => ("%", PRODUCT, [PRODUCT, SIGN]),
        Arithmetic::Power => ("**", POWER, [WHOLE, SIGN]),
    }
}

fn globals_set_in(body: &[Statement], found: &mut BTreeSet<usize>) {
    for statement in body {
        match &statement.kind {
            StatementKind::Set(Variable::Global(number), _)
            | StatementKind::Change(Variable::Global(number), _) => {
                found.insert(*number);
            }
            StatementKind::Repeat { body, .. } | StatementKind::While { body, .. } => {
                globals_set_in(body, found)
            }
            StatementKind::If { branches, otherwise } => {
                branches.iter().for_each(|(_, body)| globals_set_in(body, found));
                globals_set_in(otherwise, found);
            }
            _ => {}
        }
    }
}
