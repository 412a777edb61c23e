//! `cargo xtask size`: flash, RAM and stack of the image for the arm, and of the parse-and-answer path, held against
//! their budgets.

use std::fs;

use crate::budget::{self, Figure};
use crate::elf::Program;
use crate::run::{ANSWER, CHIP, IMAGE, Linked, Outcome, SMALL, link, run};
use crate::stack::{CallGraph, Depth};

/// Where RAM begins (RM0090, section 2.3): what lies below is flash.
const RAM: u64 = 0x2000_0000;
/// What the cores are called in the paths of source files, and in the names of data.
const CORES: &[(&str, &str)] = &[("protocol-core/", "protocol_core::"), ("motion-core/", "motion_core::")];
/// The program in which the path is fed under a meter, and the one whose server does nothing.
const OURS: Linked = Linked { name: "count_ours", profile: SMALL };
const NOTHING: &str = "count_nothing";
/// The function in which a server does its work.
const FEED: &str = "footprint::count_server::feed";

/// Measures, prints, and holds the sizes against their budgets.
pub(crate) fn check(accept: bool) -> Outcome {
    link()?;
    let mut figures = image()?;
    figures.push(with(&ANSWER, |program| Ok(Figure::new("answer: program, bytes", flash(program))))?);
    figures.push(Figure::new("path: stack, bytes", stack_of_path(&OURS)?));
    figures.push(Figure::new("path: flash, bytes", flash_of_path(&OURS)?));
    println!();
    budget::hold("size", &figures, accept)?;
    print_hash()
}

fn image() -> Outcome<Vec<Figure>> {
    with(&IMAGE, |program| {
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

fn with<T>(linked: &Linked, look: impl FnOnce(&Program<'_>) -> Outcome<T>) -> Outcome<T> {
    look(&Program::read(&linked.read()?)?)
}

/// Everything that has to be flashed: vectors, code, constants, and what variables start with.
fn flash(program: &Program<'_>) -> u64 {
    let sections = program.sections.iter().filter(|section| section.address < RAM || section.name == ".data");
    sections.map(|section| section.size).sum()
}

fn ram(program: &Program<'_>) -> u64 {
    program.sections.iter().filter(|section| section.address >= RAM).map(|section| section.size).sum()
}

/// Code that is there for a file of the cores, and their constants that have a name.
fn cores_share(program: &Program<'_>) -> Outcome<u64> {
    let mut share = 0;
    for (address, length) in program.stretches()? {
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

/// How deep the stack gets while a server is fed.
pub(crate) fn stack_of_path(linked: &Linked) -> Outcome<u64> {
    with(linked, |program| Ok(CallGraph::of(program)?.depth(program.address_of(FEED)?)?.bytes))
}

/// What a program is larger by than the one whose server does nothing.
pub(crate) fn flash_of_path(linked: &Linked) -> Outcome<u64> {
    let all = with(linked, |program| Ok(flash(program)))?;
    let nothing = Linked { name: NOTHING, profile: linked.profile };
    let nothing = with(&nothing, |program| Ok(flash(program)))?;
    Ok(all.saturating_sub(nothing))
}

fn print_depth(depth: &Depth) {
    println!("deepest stack of the image, bytes:");
    for (name, bytes) in &depth.path {
        println!("{bytes:10}  {name}");
    }
}

/// The file that is flashed is the one that is tested in the emulator: here is how to tell.
fn print_hash() -> Outcome {
    let path = IMAGE.path();
    println!("\n{} bytes of ELF, to be compared with what is flashed:", fs::metadata(&path)?.len());
    run("sha256sum", &format!("target/{CHIP}/{}/{}", IMAGE.profile, IMAGE.name), &[])
}
