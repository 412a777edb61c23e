//! `cargo xtask no-panic`: the cores, linked for the chip, and the firmware contain no reachable panic.
//!
//! The linker removes code that nothing refers to. So if the program contains the panic handler, or a function of `core` that
//! leads to it, some line can panic. The debug information shows which line.

use crate::run::{TaskResult, link};
use linked_image::{Program, SourceLine, Symbol};

/// Packages that may panic. defmt-rtt panics if a log frame begins inside another. This cannot happen, because the logger
/// runs in a critical section.
const EXEMPT: &[&str] = &["/defmt-rtt-"];

/// Links the cores and the firmware, and fails if a panic is reachable.
pub(crate) fn check() -> TaskResult {
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
    if reachable == 0 { Ok(()) } else { Err("a panic is reachable: see above".into()) }
}

/// A function that panics.
struct Panic<'a> {
    name: &'a str,
    calls: Vec<Call<'a>>,
}

/// A call of a panic, from a function that is not a panic itself.
struct Call<'a> {
    caller: &'a str,
    /// Lines of source, innermost first.
    lines: Vec<SourceLine>,
}

/// The functions that panic, except functions that only [`EXEMPT`] packages and other panics call.
fn panics<'a>(program: &'a Program<'_>) -> TaskResult<Vec<Panic<'a>>> {
    let mut found = Vec::new();
    for symbol in program.symbols.iter().filter(|symbol| is_panic(symbol)) {
        let (calls, is_exempt_only) = calls_to(program, symbol)?;
        if !is_exempt_only {
            found.push(Panic { name: &symbol.name, calls });
        }
    }
    Ok(found)
}

/// The calls of a panic that come neither from other panics nor from [`EXEMPT`] packages. The second value is true if the panic
/// has calls, but only from these. A panic without any call counts as reachable, because its address must be in use.
fn calls_to<'a>(program: &'a Program<'_>, panic: &Symbol) -> TaskResult<(Vec<Call<'a>>, bool)> {
    let addresses = program.calls_to(panic.address);
    let mut calls = Vec::new();
    for &address in &addresses {
        let caller = program.function_at(address);
        let lines = program.source_of(address)?;
        let is_exempt = |line: &SourceLine| EXEMPT.iter().any(|package| line.file.contains(package));
        if !caller.is_some_and(is_panic) && !lines.iter().any(is_exempt) {
            let caller = caller.map_or("code without a name", |caller| &caller.name);
            calls.push(Call { caller, lines });
        }
    }
    let is_exempt_only = calls.is_empty() && !addresses.is_empty();
    Ok((calls, is_exempt_only))
}

impl Panic<'_> {
    fn print(&self) {
        println!("  {}", self.name);
        for call in &self.calls {
            println!("    called in {}", call.caller);
            for line in &call.lines {
                println!("      {line}");
            }
        }
    }
}

/// True for the panic handler, and for functions of `core` that call it.
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
    fn panics_differ_from_other_functions() {
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
