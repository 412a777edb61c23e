//! Runs programs of `footprint` in the emulator. They count the instructions of the cores and their peers, and print the counts.

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use crate::run::{ChildProcess, ChipProgram, TaskResult};

/// A name and a number that a program printed.
pub(crate) type NamedCount = (String, u64);

/// Runs a program in the emulator and returns its counts.
pub(crate) fn figures(program: &ChipProgram) -> TaskResult<Vec<NamedCount>> {
    let child = emulator::qemu(program)
        .args(["-chardev", "stdio,id=figures,signal=off", "-serial", "chardev:figures"])
        .args(["-icount", "shift=0,sleep=off"])
        .stdout(Stdio::piped())
        .spawn()?;
    let mut child = ChildProcess(child);
    let output = child.0.stdout.take().ok_or("the emulator has no output")?;
    let mut figures = Vec::new();
    for line in BufReader::new(output).lines() {
        match line?.split_once('\t') {
            Some((name, figure)) => figures.push((name.to_owned(), figure.parse()?)),
            None => return Ok(figures),
        }
    }
    Err(format!("{} ended before its last count", program.name))?
}
