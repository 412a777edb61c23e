//! `cargo xtask docs`: the circuit drawings in docs/circuits, one SVG for each table of parts in [`circuits`], and
//! docs/kinematics.svg.
//!
//! ```text
//!   circuits.rs ──▶ drawing.rs ──▶ part.rs ──▶ sheet.rs ──▶ docs/circuits/*.svg
//!   (which parts,   (name, size)   (terminals,  (lines and
//!    and where)                     shape)       text as SVG)
//!
//!   kinematics ──▶ arm.rs ──▶ docs/kinematics.svg
//! ```

use std::fs;
use std::path::PathBuf;

use crate::run::{TaskResult, root};

mod arm;
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

/// Every drawing, with its path.
fn all() -> impl Iterator<Item = (PathBuf, String)> {
    let circuits = circuits::all().into_iter().map(|drawing| (path(&drawing), drawing.svg()));
    circuits.chain([(root().join("docs/kinematics.svg"), arm::svg())])
}

/// Writes every drawing.
pub(crate) fn write() -> TaskResult {
    fs::create_dir_all(folder())?;
    for (path, svg) in all() {
        fs::write(path, svg)?;
    }
    Ok(())
}

/// Fails if a drawing differs from the one that [`write()`] writes.
pub(crate) fn check() -> TaskResult {
    for (path, svg) in all() {
        if fs::read_to_string(&path).unwrap_or_default() != svg {
            return Err(format!("{} is out of date: run `cargo xtask docs`", path.display()).into());
        }
    }
    println!("docs/circuits and docs/kinematics.svg are up to date");
    Ok(())
}

fn folder() -> PathBuf {
    root().join("docs/circuits")
}
