//! The largest stack of a program for the chip, from the file that is flashed: pushes, calls and exceptions.
//!
//! The result is an upper bound, because all pushes of a function count, on any path. Recursion, calls through a pointer,
//! unknown instructions, and a stack that grows in a loop are refused.

use std::collections::BTreeMap;

use crate::ReadResult;
use crate::elf::{Program, Symbol};
use crate::thumb_decode::Effect;

/// Bytes that the core pushes for an exception: 26 words with floating point, and one for alignment (ARMv7-M reference
/// manual, B1.5.7).
const EXCEPTION_FRAME: u64 = 27 * 4;
/// Functions that begin with an empty stack. They may set the stack pointer, to the top of the stack.
const SETS_STACK: &[&str] = &["Reset", "HardFault"];

/// Calls that are left out: from each of these functions of the logger to the panic. The logger panics if a log frame begins
/// inside another or ends without a beginning, and the panic handler logs, so these calls close a cycle. The handler logs only
/// when it is entered for the first time (`crash.rs`, `ENTERED`), so the cycle is executed once.
const GUARDS: (&[&str], &str) = (&["_defmt_acquire", "_defmt_release"], "core::panicking::panic_fmt");

/// The largest stack of a function with its callees.
#[derive(Clone, Default)]
pub struct Depth {
    /// Its size in bytes: the sum of those in `path`.
    pub bytes: u64,
    /// The functions of the deepest path, outermost first, with the bytes of each.
    pub path: Vec<(String, u64)>,
}

/// The stack use of a function.
struct StackFunction<'a> {
    symbol: &'a Symbol,
    pushed: u64,
    /// The addresses of the functions that it calls or continues with.
    calls: Vec<u64>,
}

/// All functions of a program, by their addresses.
pub struct CallGraph<'a>(BTreeMap<u64, StackFunction<'a>>);

impl<'a> CallGraph<'a> {
    /// Reads the functions of a program. Refuses a function whose stack has no known bound, or that continues where no function is
    /// known.
    pub fn of(program: &'a Program<'_>) -> ReadResult<Self> {
        let mut graph = BTreeMap::new();
        let (guards, panic) = GUARDS;
        let panic = program.address_of(panic).ok();
        for symbol in program.functions() {
            let mut function = StackFunction::of(symbol, program)?;
            if guards.contains(&function.name()) {
                function.calls.retain(|&to| Some(to) != panic);
            }
            graph.insert(symbol.address, function);
        }
        let graph = Self(graph);
        for function in graph.0.values() {
            graph.check_calls(function)?;
        }
        Ok(graph)
    }

    fn check_calls(&self, function: &StackFunction<'_>) -> ReadResult<()> {
        match function.calls.iter().find(|to| !self.0.contains_key(to)) {
            Some(to) => Err(format!("{} continues at {to:#x}, where no function is known", function.name()))?,
            None => Ok(()),
        }
    }

    /// The stack of the function at `address`.
    pub fn depth(&self, address: u64) -> ReadResult<Depth> {
        self.depth_from(address, &mut Vec::new(), &mut BTreeMap::new())
    }

    fn depth_from(
        &self,
        at: u64,
        callers: &mut Vec<u64>,
        depths: &mut BTreeMap<u64, Depth>,
    ) -> ReadResult<Depth> {
        if let Some(depth) = depths.get(&at) {
            return Ok(depth.clone());
        }
        let function = self.0.get(&at).ok_or_else(|| format!("no function is known at {at:#x}"))?;
        if callers.contains(&at) {
            Err(format!("{} may call itself: the stack has no bound", function.name()))?;
        }
        callers.push(at);
        let mut deepest = Depth::default();
        for &callee in &function.calls {
            let depth = self.depth_from(callee, callers, depths)?;
            deepest = if depth.bytes > deepest.bytes { depth } else { deepest };
        }
        callers.pop();
        deepest.bytes += function.pushed;
        deepest.path.insert(0, (function.name().to_owned(), function.pushed));
        depths.insert(at, deepest.clone());
        Ok(deepest)
    }

    /// The largest stack of the whole program: the program after reset, interrupted by every other exception once, each when the
    /// stack of the one before it is deepest. Priorities allow less nesting than that. A hard fault starts a new stack. The
    /// result includes the stack of two panics in the logger, because `GUARDS` leaves out these calls.
    pub fn worst(&self, program: &Program<'_>) -> ReadResult<Depth> {
        let [reset, handlers @ ..] = program.handlers() else { Err("no vector table")? };
        let mut whole = self.depth(*reset)?;
        for &handler in handlers {
            let depth = self.depth(handler)?;
            let begins_anew = depth.path.first().is_some_and(|(name, _)| sets_stack(name));
            if begins_anew {
                whole = if depth.bytes > whole.bytes { depth } else { whole };
                continue;
            }
            whole.bytes += EXCEPTION_FRAME + depth.bytes;
            whole.path.push(("(interrupted)".to_owned(), EXCEPTION_FRAME));
            whole.path.extend(depth.path);
        }
        if let Ok(panic) = program.address_of(GUARDS.1) {
            let depth = self.depth(panic)?;
            whole.bytes += 2 * depth.bytes;
            whole.path.push(("(panics in the logger)".to_owned(), 2 * depth.bytes));
        }
        Ok(whole)
    }
}

impl<'a> StackFunction<'a> {
    fn of(symbol: &'a Symbol, program: &Program<'_>) -> ReadResult<Self> {
        let mut function = Self { symbol, pushed: 0, calls: Vec::new() };
        let (mut pushes, mut loops) = (Vec::new(), Vec::new());
        for (at, effect) in program.instructions_of(symbol) {
            match effect {
                Effect::Call(to) => function.calls.push(to),
                Effect::Jump(to) if !symbol.holds(to) => function.calls.push(to),
                Effect::Jump(to) if to <= at => loops.push(to..=at),
                Effect::Push(bytes) => {
                    function.pushed += bytes;
                    pushes.push(at);
                }
                Effect::Indirect => match program.jump_targets(symbol, at) {
                    Some(targets) => {
                        loops.extend(targets.into_iter().filter(|&to| to <= at).map(|to| to..=at))
                    }
                    None => function.refuse(at, "calls through a pointer")?,
                },
                Effect::Unknown => function.refuse(at, "contains an unknown instruction")?,
                Effect::SetStackPointer if !sets_stack(&symbol.name) => {
                    function.refuse(at, "sets the stack pointer")?;
                }
                _ => {}
            }
        }
        match pushes.iter().find(|at| loops.iter().any(|range| range.contains(at))) {
            Some(&at) => function.refuse(at, "grows the stack in a loop").map(|()| function),
            None => Ok(function),
        }
    }

    fn name(&self) -> &'a str {
        &self.symbol.name
    }

    fn refuse(&self, at: u64, what: &str) -> ReadResult<()> {
        Err(format!("{} {what}, at {at:#x}: no bound of the stack is known", self.name()))?
    }
}

fn sets_stack(name: &str) -> bool {
    SETS_STACK.contains(&name)
}
