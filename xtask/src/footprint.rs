//! `cargo xtask size`: flash, RAM and stack of the image for the arm, and of the parse-and-reply path, compared with their
//! budgets.

use std::fs;
use std::process::Command;

use crate::budget::{self, Figure};
use crate::run::{ANSWER, ChipProgram, IMAGE, SMALL, TaskResult, link, run_command};
use linked_image::Program;
use linked_image::{CallGraph, Depth};

/// The start of RAM (RM0090, section 2.3). Flash is below.
const RAM: u64 = 0x2000_0000;
/// The cores in the paths of source files, and in the names of data.
const CORES: &[(&str, &str)] = &[("protocol-core/", "protocol_core::"), ("motion-core/", "motion_core::")];
/// The program with the parse-and-reply path, and the program with a server that does nothing.
const OURS: ChipProgram = ChipProgram { name: "count_ours", profile: SMALL };
const NOTHING: &str = "count_nothing";
/// The function that calls the server.
const FEED: &str = "footprint::count_server::feed";

/// Measures, prints, and compares the sizes with their budgets.
pub(crate) fn check(accept: bool) -> TaskResult {
    link()?;
    let mut figures = image()?;
    figures.push(with_program(&ANSWER, |program| Ok(Figure::new("answer: program, bytes", flash(program))))?);
    figures.push(Figure::new("path: stack, bytes", stack_of_path(&OURS)?));
    figures.push(Figure::new("path: flash, bytes", flash_of_path(&OURS)?));
    println!();
    budget::check("size", &figures, accept)?;
    print_hash()
}

fn image() -> TaskResult<Vec<Figure>> {
    with_program(&IMAGE, |program| {
        let stack = CallGraph::of(program)?.worst(program)?;
        print_depth(&stack);
        Ok(vec![
            Figure::new("image: program, bytes of flash", flash(program)),
            Figure::new("image: share of protocol-core and motion-core, bytes", cores_share(program)?),
            Figure::new("image: static RAM, bytes", ram(program)),
            Figure::new("image: deepest stack, bytes", stack.bytes),
        ])
    })
}

fn with_program<T>(linked: &ChipProgram, look: impl FnOnce(&Program<'_>) -> TaskResult<T>) -> TaskResult<T> {
    look(&Program::read(&linked.read()?)?)
}

/// The contents of the flash: vectors, code, constants, and initial values of variables.
fn flash(program: &Program<'_>) -> u64 {
    let sections = program.sections.iter().filter(|section| section.address < RAM || section.name == ".data");
    sections.map(|section| section.size).sum()
}

fn ram(program: &Program<'_>) -> u64 {
    program.sections.iter().filter(|section| section.address >= RAM).map(|section| section.size).sum()
}

/// The code attributed to files of the cores, and their named constants.
fn cores_share(program: &Program<'_>) -> TaskResult<u64> {
    let mut share = 0;
    for (address, length) in program.line_ranges()? {
        let places = program.source_of(address)?;
        let ours = places.iter().find(|place| place.is_ours);
        if ours.is_some_and(|place| CORES.iter().any(|(folder, _)| place.file.starts_with(folder))) {
            share += length;
        }
    }
    let constants = program.symbols.iter().filter(|symbol| !symbol.is_function && symbol.address < RAM);
    let of_cores = constants.filter(|symbol| CORES.iter().any(|(_, path)| symbol.name.contains(path)));
    Ok(share + of_cores.map(|symbol| symbol.size).sum::<u64>())
}

/// The deepest stack of a server.
pub(crate) fn stack_of_path(linked: &ChipProgram) -> TaskResult<u64> {
    with_program(linked, |program| Ok(CallGraph::of(program)?.depth(program.address_of(FEED)?)?.bytes))
}

/// The size of a program minus the size of the program with a server that does nothing.
pub(crate) fn flash_of_path(linked: &ChipProgram) -> TaskResult<u64> {
    let all = with_program(linked, |program| Ok(flash(program)))?;
    let nothing = ChipProgram { name: NOTHING, profile: linked.profile };
    let nothing = with_program(&nothing, |program| Ok(flash(program)))?;
    Ok(all.saturating_sub(nothing))
}

fn print_depth(depth: &Depth) {
    println!("deepest stack of the image, bytes:");
    for (name, bytes) in &depth.path {
        println!("{bytes:10}  {name}");
    }
}

/// Prints the hash of the image, which identifies the file that is flashed and tested in the emulator.
fn print_hash() -> TaskResult {
    let path = IMAGE.path();
    println!("\n{} bytes of ELF, to be compared with what is flashed:", fs::metadata(&path)?.len());
    run_command(Command::new("sha256sum").arg(&path))
}
