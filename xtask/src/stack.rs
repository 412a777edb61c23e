//! How deep the stack of a program for the chip can get, from the very file that is flashed: what each function
//! pushes, who calls whom, and what interrupts whom.
//!
//! A bound, not an estimate: of a function every push counts, on whichever path it lies. What would make it none
//! is refused: recursion, calls through a pointer, a stack that grows in a loop.

use std::collections::BTreeMap;

use crate::elf::{Program, Symbol};
use crate::run::Outcome;
use crate::thumb_decode::Effect;

/// What the core pushes when an interrupt comes: 26 words where the program uses floating point, and one that
/// aligns (ARMv7-M reference manual, B1.5.7).
const EXCEPTION_FRAME: u64 = 27 * 4;
/// Functions that set the stack pointer on purpose: both begin a stack from its top.
const BEGIN_A_STACK: &[&str] = &["Reset", "HardFault"];

/// Where the logger panics if a log frame begins inside another: a call that closes a circle, since a panic is logged.
/// The panic handler logs only when it is entered for the first time (`crash.rs`, `ENTERED`), so a circle is run
/// through once, and its beginning once more.
const GUARDS: (&[&str], &str) = (&["_defmt_acquire", "_defmt_release"], "core::panicking::panic_fmt");

/// How deep the stack gets from a function on.
#[derive(Clone, Default)]
pub(crate) struct Depth {
    /// In bytes.
    pub(crate) bytes: u64,
    /// The way there, outermost first, with what each function takes itself.
    pub(crate) path: Vec<(String, u64)>,
}

/// What of a function counts here.
struct Function<'a> {
    symbol: &'a Symbol,
    pushed: u64,
    /// Where the functions begin that it calls or goes on to.
    calls: Vec<u64>,
}

/// All functions of a program, by their addresses.
pub(crate) struct CallGraph<'a>(BTreeMap<u64, Function<'a>>);

impl<'a> CallGraph<'a> {
    /// Reads the code of a program.
    pub(crate) fn of(program: &'a Program<'_>) -> Outcome<Self> {
        let mut graph = BTreeMap::new();
        let (guards, panic) = GUARDS;
        let panic = program.address_of(panic).ok();
        for symbol in program.functions() {
            let mut function = Function::of(symbol, program)?;
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

    fn check_calls(&self, function: &Function<'_>) -> Outcome {
        match function.calls.iter().find(|to| !self.0.contains_key(to)) {
            Some(to) => Err(format!("{} goes on at {to:#x}: no function is known there", function.name()))?,
            None => Ok(()),
        }
    }

    /// How deep the stack gets from the function at `address` on.
    pub(crate) fn depth(&self, address: u64) -> Outcome<Depth> {
        self.descend(address, &mut Vec::new(), &mut BTreeMap::new())
    }

    fn descend(&self, at: u64, way: &mut Vec<u64>, known: &mut BTreeMap<u64, Depth>) -> Outcome<Depth> {
        if let Some(depth) = known.get(&at) {
            return Ok(depth.clone());
        }
        let function = self.0.get(&at).ok_or_else(|| format!("no function is known at {at:#x}"))?;
        if way.contains(&at) {
            Err(format!("{} can come to call itself: the stack has no bound", function.name()))?;
        }
        way.push(at);
        let mut deepest = Depth::default();
        for &callee in &function.calls {
            let depth = self.descend(callee, way, known)?;
            deepest = if depth.bytes > deepest.bytes { depth } else { deepest };
        }
        way.pop();
        deepest.bytes += function.pushed;
        deepest.path.insert(0, (function.name().to_owned(), function.pushed));
        known.insert(at, deepest.clone());
        Ok(deepest)
    }

    /// How deep the stack of the whole program gets: from reset, with every other exception coming once, each in
    /// the worst moment of the one before. That is more than priorities allow. A hard fault begins a stack of its
    /// own.
    pub(crate) fn worst(&self, program: &Program<'_>) -> Outcome<Depth> {
        let [reset, handlers @ ..] = program.handlers() else { Err("no vector table")? };
        let mut whole = self.depth(*reset)?;
        for &handler in handlers {
            let depth = self.depth(handler)?;
            let begins_anew = depth.path.first().is_some_and(|(name, _)| begins_a_stack(name));
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

impl<'a> Function<'a> {
    fn of(symbol: &'a Symbol, program: &Program<'_>) -> Outcome<Self> {
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
                Effect::Unknown => function.refuse(at, "holds an unknown instruction")?,
                Effect::SetStackPointer if !begins_a_stack(&symbol.name) => {
                    function.refuse(at, "sets the stack pointer")?;
                }
                _ => {}
            }
        }
        match pushes.iter().find(|at| loops.iter().any(|range| range.contains(at))) {
            Some(&at) => function.refuse(at, "lets the stack grow in a loop").map(|()| function),
            None => Ok(function),
        }
    }

    fn name(&self) -> &'a str {
        &self.symbol.name
    }

    fn refuse(&self, at: u64, what: &str) -> Outcome {
        Err(format!("{} {what}, at {at:#x}: the stack has no bound that is known", self.name()))?
    }
}

fn begins_a_stack(name: &str) -> bool {
    BEGIN_A_STACK.contains(&name)
}
