//! `cargo xtask size --by-file`: what the cores cost on the chip, by section and by file of source.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::elf::{Place, Program, Symbol};
use crate::run::{Outcome, link};

/// Functions the compiler calls to copy, fill and compare more than a few bytes.
const COPIERS: &[&str] = &["memcpy", "memmove", "memset", "memclr", "memcmp"];

/// Links the cores and the image and prints what they take, by section and by file of source.
pub(crate) fn print() -> Outcome {
    for linked in link()? {
        let file = linked.read()?;
        let program = Program::read(&file)?;
        println!("\n{}, bytes", linked.name);
        for section in &program.sections {
            println!("{:8}  {}", section.size, section.name);
        }
        print_files(&program)?;
        print_copiers(&program)?;
    }
    Ok(())
}

fn print_files(program: &Program<'_>) -> Outcome {
    println!("of .text, by the file it is there for:");
    let mut files: BTreeMap<String, u64> = BTreeMap::new();
    for (address, length) in program.stretches()? {
        *files.entry(reason(&program.source_of(address)?)).or_default() += length;
    }
    let mut files: Vec<_> = files.into_iter().collect();
    files.sort_by_key(|&(_, size)| Reverse(size));
    for (file, size) in files {
        println!("{size:8}  {file}");
    }
    Ok(())
}

/// The file that code is there for: the innermost of ours, into which the rest was inlined, or else the
/// outermost package.
fn reason(places: &[Place]) -> String {
    let ours = places.iter().find(|place| place.is_ours);
    let theirs = || places.last().map_or("(no line of source)", |place| package(&place.file));
    ours.map_or_else(|| theirs().to_owned(), |place| place.file.clone())
}

/// The package a file from outside the workspace belongs to.
fn package(file: &str) -> &str {
    let mut folders = file.split("/src/").next().unwrap_or(file).rsplit('/');
    folders.next().unwrap_or(file)
}

fn print_copiers(program: &Program<'_>) -> Outcome {
    for copier in program.symbols.iter().filter(|symbol| is_copier(symbol)) {
        for call in program.calls_to(copier.address) {
            if let Some(place) = program.source_of(call)?.iter().find(|place| place.is_ours) {
                println!("{} is called from {place}", copier.name);
            }
        }
    }
    Ok(())
}

/// Is this one of [`COPIERS`], or its form for aligned data: `__aeabi_memcpy4`?
fn is_copier(symbol: &Symbol) -> bool {
    let name = symbol.name.rsplit("::").next().unwrap_or(&symbol.name);
    let name = name.trim_start_matches("__aeabi_").trim_end_matches(['4', '8']);
    symbol.is_function && COPIERS.contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_from_outside_count_for_their_package() {
        assert_eq!(package("compiler-builtins/compiler-builtins/src/arm.rs"), "compiler-builtins");
        assert_eq!(package("crates.io-1949cf8c/cortex-m-rt-0.7.7/src/lib.rs"), "cortex-m-rt-0.7.7");
        assert_eq!(package("core/src/option.rs"), "core");
    }

    #[test]
    fn copiers_are_known_by_all_their_names() {
        let is_copier =
            |name: &str| is_copier(&Symbol { name: name.to_owned(), address: 0, size: 0, is_function: true });
        assert!(is_copier("memcpy"));
        assert!(is_copier("__aeabi_memclr8"));
        assert!(is_copier("compiler_builtins::mem::memmove"));
        assert!(!is_copier("protocol_core::wire::Deframer::push"));
    }
}
