//! `cargo xtask no-panic`: the cores, linked for the chip, hold no path to a panic.
//!
//! The linker leaves out what nothing refers to. So if the panic handler, or anything of `core` that ends
//! there, is in the program, then some line of the cores can panic; which one, the debug information says.

use crate::elf::{Program, Symbol};
use crate::run::{Outcome, link_footprint, linked};

/// The programs of `footprint`.
pub(crate) const PROGRAMS: &[&str] = &["answer", "arm", "rest_of_motion", "rest_of_protocol"];

/// Links the cores and fails if a panic survived.
pub(crate) fn check() -> Outcome {
    link_footprint()?;
    let mut survivors = 0;
    for name in PROGRAMS {
        let file = linked(name)?;
        let program = Program::read(&file)?;
        let panics: Vec<_> = program.symbols.iter().filter(|symbol| is_panic(symbol)).collect();
        println!("{name}: {} functions, {} of them panic", functions(&program), panics.len());
        for panic in &panics {
            report(&program, panic)?;
        }
        survivors += panics.len();
    }
    if survivors == 0 { Ok(()) } else { Err("a panic can be reached; the lines above say where from".into()) }
}

fn functions(program: &Program<'_>) -> usize {
    program.symbols.iter().filter(|symbol| symbol.is_function).count()
}

/// Is this the panic handler, or a function of `core` that leads to it?
fn is_panic(symbol: &Symbol) -> bool {
    let name = symbol.name.as_str();
    let of_core = name.starts_with("core::") || name.starts_with('<');
    let fails = ["::panicking::", "::unwrap_failed", "::expect_failed", "_fail", "::panic_"];
    symbol.is_function
        && (name.contains("rust_begin_unwind") || of_core && fails.iter().any(|mark| name.contains(mark)))
}

/// Prints a function that panics, and each place in the source from which it is called.
fn report(program: &Program<'_>, panic: &Symbol) -> Outcome {
    println!("  {}", panic.name);
    for call in program.calls_to(panic.address) {
        let caller = program.function_at(call);
        if caller.is_some_and(is_panic) {
            continue;
        }
        println!("    called in {}", caller.map_or("code without a name", |caller| &caller.name));
        for place in program.source_of(call)? {
            println!("      {place}");
        }
    }
    Ok(())
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
