//! `cargo xtask size --by-file`: the sizes of the cores and the image on the chip, by section and source file.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::run::{TaskResult, link};
use linked_image::{Program, SourceLine, Symbol};

/// Functions that the compiler calls to copy, fill and compare more than a few bytes.
const COPY_FUNCTIONS: &[&str] = &["memcpy", "memmove", "memset", "memclr", "memcmp"];

/// Links the cores and the image, and prints their sizes by section and source file.
pub(crate) fn print() -> TaskResult {
    for linked in link()? {
        let file = linked.read()?;
        let program = Program::read(&file)?;
        println!("\n{}, bytes", linked.name);
        for section in &program.sections {
            println!("{:8}  {}", section.size, section.name);
        }
        print_files(&program)?;
        print_copy_calls(&program)?;
    }
    Ok(())
}

fn print_files(program: &Program<'_>) -> TaskResult {
    println!("of .text, by source file:");
    let mut files: BTreeMap<String, u64> = BTreeMap::new();
    for (address, length) in program.line_ranges()? {
        *files.entry(attributed_file(&program.source_of(address)?)).or_default() += length;
    }
    let mut files: Vec<_> = files.into_iter().collect();
    files.sort_by_key(|&(_, size)| Reverse(size));
    for (file, size) in files {
        println!("{size:8}  {file}");
    }
    Ok(())
}

/// The file to which code is attributed: the innermost file of ours that it was inlined into, or the outermost package.
fn attributed_file(lines: &[SourceLine]) -> String {
    let ours = lines.iter().find(|line| line.is_ours);
    let external = || lines.last().map_or("(no line of source)", |line| package(&line.file));
    ours.map_or_else(|| external().to_owned(), |line| line.file.clone())
}

/// The package of a file outside the workspace.
fn package(file: &str) -> &str {
    let mut folders = file.split("/src/").next().unwrap_or(file).rsplit('/');
    folders.next().unwrap_or(file)
}

fn print_copy_calls(program: &Program<'_>) -> TaskResult {
    for function in program.symbols.iter().filter(|symbol| is_copy_function(symbol)) {
        for call in program.calls_to(function.address) {
            if let Some(line) = program.source_of(call)?.iter().find(|line| line.is_ours) {
                println!("{} is called from {line}", function.name);
            }
        }
    }
    Ok(())
}

/// True for [`COPY_FUNCTIONS`] and their forms for aligned data, such as `__aeabi_memcpy4`.
fn is_copy_function(symbol: &Symbol) -> bool {
    let name = symbol.name.rsplit("::").next().unwrap_or(&symbol.name);
    let name = name.trim_start_matches("__aeabi_").trim_end_matches(['4', '8']);
    symbol.is_function && COPY_FUNCTIONS.contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn external_files_are_attributed_to_their_package() {
        assert_eq!(package("compiler-builtins/compiler-builtins/src/arm.rs"), "compiler-builtins");
        assert_eq!(package("crates.io-1949cf8c/cortex-m-rt-0.7.7/src/lib.rs"), "cortex-m-rt-0.7.7");
        assert_eq!(package("core/src/option.rs"), "core");
    }

    #[test]
    fn copy_functions_are_found_by_all_their_names() {
        let is_copy_function = |name: &str| {
            is_copy_function(&Symbol { name: name.to_owned(), address: 0, size: 0, is_function: true })
        };
        assert!(is_copy_function("memcpy"));
        assert!(is_copy_function("__aeabi_memclr8"));
        assert!(is_copy_function("compiler_builtins::mem::memmove"));
        assert!(!is_copy_function("protocol_core::wire::Deframer::push"));
    }
}
