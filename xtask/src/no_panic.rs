//! `cargo xtask no-panic`: the cores, linked for the chip, hold no path to a panic, and neither does the
//! firmware.
//!
//! The linker leaves out what nothing refers to. So if the panic handler, or anything of `core` that leads
//! to it, is in the program, then some line can panic; which one, the debug information says.

use crate::elf::{Place, Program, Symbol};
use crate::run::{Outcome, link};

/// Packages that may panic. defmt-rtt does where a log frame begins inside another, which takes a logger
/// that interrupts itself: it runs in a critical section.
const EXCUSED: &[&str] = &["/defmt-rtt-"];

/// Links the cores and the firmware, and fails if a panic can be reached.
pub(crate) fn check() -> Outcome {
    let mut reachable = 0;
    for linked in link()? {
        let file = linked.read()?;
        let program = Program::read(&file)?;
        let panics = panics(&program)?;
        let functions = program.symbols.iter().filter(|symbol| symbol.is_function).count();
        println!("{}: {functions} functions, {} of them panic", linked.name, panics.len());
        for panic in &panics {
            panic.print();
        }
        reachable += panics.len();
    }
    if reachable == 0 { Ok(()) } else { Err("a panic can be reached; the lines above say where from".into()) }
}

/// A function that panics.
struct Panic<'a> {
    name: &'a str,
    calls: Vec<Call<'a>>,
}

/// A call of it, from a function that does not exist to panic.
struct Call<'a> {
    caller: &'a str,
    /// Innermost first.
    places: Vec<Place>,
}

/// The functions that panic, less those that only the [`EXCUSED`] and other panics call.
fn panics<'a>(program: &'a Program<'_>) -> Outcome<Vec<Panic<'a>>> {
    let mut found = Vec::new();
    for symbol in program.symbols.iter().filter(|symbol| is_panic(symbol)) {
        let (calls, is_innocent) = calls_to(program, symbol)?;
        if !is_innocent {
            found.push(Panic { name: &symbol.name, calls });
        }
    }
    Ok(found)
}

/// The calls of a panic that are not excused, and whether all there are come from panics or are excused. A
/// panic that nothing calls is not innocent: its address must have been taken.
fn calls_to<'a>(program: &'a Program<'_>, panic: &Symbol) -> Outcome<(Vec<Call<'a>>, bool)> {
    let addresses = program.calls_to(panic.address);
    let mut calls = Vec::new();
    for &address in &addresses {
        let caller = program.function_at(address);
        let places = program.source_of(address)?;
        let excused = |place: &Place| EXCUSED.iter().any(|package| place.file.contains(package));
        if !caller.is_some_and(is_panic) && !places.iter().any(excused) {
            let caller = caller.map_or("code without a name", |caller| &caller.name);
            calls.push(Call { caller, places });
        }
    }
    let is_innocent = calls.is_empty() && !addresses.is_empty();
    Ok((calls, is_innocent))
}

impl Panic<'_> {
    fn print(&self) {
        println!("  {}", self.name);
        for call in &self.calls {
            println!("    called in {}", call.caller);
            for place in &call.places {
                println!("      {place}");
            }
        }
    }
}

/// Is this the panic handler, or a function of `core` that leads to it?
fn is_panic(symbol: &Symbol) -> bool {
    let name = symbol.name.as_str();
    let of_core = name.starts_with("core::") || name.starts_with('<');
    let fails = ["::panicking::", "::unwrap_failed", "::expect_failed", "_fail", "::panic_"];
    symbol.is_function
        && (name.contains("rust_begin_unwind") || of_core && fails.iter().any(|mark| name.contains(mark)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_are_told_from_other_functions() {
        let panics =
            |name: &str| is_panic(&Symbol { name: name.to_owned(), address: 0, size: 0, is_function: true });
        assert!(panics("core::panicking::panic_bounds_check"));
        assert!(panics("core::slice::index::slice_index_fail"));
        assert!(panics("core::option::unwrap_failed"));
        assert!(panics("<[u8]>::copy_from_slice::len_mismatch_fail"));
        assert!(panics("core::cell::panic_already_borrowed"));
        assert!(panics("__rustc::rust_begin_unwind"));
        assert!(!panics("motion_core::servo_bus::read_failed"));
        assert!(!panics("memcpy"));
    }
}
