//! The cores and their peers alone: programs of `footprint` that count themselves and tell the figures.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::emulate;
use crate::run::{Linked, Outcome, Running};

/// A name and a number, as a program told them.
pub(crate) type Told = (String, u64);

/// Runs a program in the emulator, and gives what it tells.
pub(crate) fn figures(program: &Linked) -> Outcome<Vec<Told>> {
    let child = Command::new(emulate::QEMU)
        .args(["-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-nodefaults"])
        .args(["-chardev", "stdio,id=figures,signal=off", "-serial", "chardev:figures"])
        .args(["-icount", "shift=0,sleep=off"])
        .arg("-kernel")
        .arg(program.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut child = Running(child);
    let output = child.0.stdout.take().ok_or("the emulator has no output")?;
    let mut figures = Vec::new();
    for line in BufReader::new(output).lines() {
        match line?.split_once('\t') {
            Some((name, figure)) => figures.push((name.to_owned(), figure.parse()?)),
            None => return Ok(figures),
        }
    }
    Err(format!("{} ended before it had told its figures", program.name))?
}
