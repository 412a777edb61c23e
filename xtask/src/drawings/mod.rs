//! `cargo xtask docs`: the circuit drawings in docs/circuits, one SVG for each table of parts in [`circuits`].
//!
//! ```text
//!   circuits.rs ──▶ drawing.rs ──▶ part.rs ──▶ sheet.rs ──▶ docs/circuits/*.svg
//!   (which parts,   (name, size)   (terminals,  (lines and
//!    and where)                     shape)       text as SVG)
//! ```

use std::fs;
use std::path::PathBuf;

use crate::run::{TaskResult, root};

mod circuits;
mod drawing;
mod part;
mod sheet;
#[cfg(test)]
mod tests;

use drawing::Drawing;

fn path(drawing: &Drawing) -> PathBuf {
    folder().join(drawing.name).with_extension("svg")
}

/// Writes every drawing.
pub(crate) fn write() -> TaskResult {
    fs::create_dir_all(folder())?;
    for drawing in circuits::all() {
        fs::write(path(&drawing), drawing.svg())?;
    }
    Ok(())
}

/// Fails if a drawing differs from the one that [`write()`] writes.
pub(crate) fn check() -> TaskResult {
    for drawing in circuits::all() {
        let path = path(&drawing);
        if fs::read_to_string(&path).unwrap_or_default() != drawing.svg() {
            return Err(format!("{} is out of date: run `cargo xtask docs`", path.display()).into());
        }
    }
    println!("docs/circuits is up to date");
    Ok(())
}

fn folder() -> PathBuf {
    root().join("docs/circuits")
}
