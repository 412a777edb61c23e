//! A linked program for the chip, read from its ELF file.
//!
//! ```text
//!   thumb_decode.rs ──▶ jump_table.rs ──▶ elf.rs ──▶ stack.rs
//!   (effect of an       (targets of       (symbols,   (deepest
//!    instruction)        a jump)           lines)      stack)
//! ```
//!
//! This crate does not know the project's programs: its callers name them, and `xtask` compares the figures with budgets.

use std::error::Error;

mod elf;
mod jump_table;
mod loaded;
mod stack;
mod thumb_decode;

pub use elf::{Program, Section, SourceLine, Symbol};
pub use loaded::{LoadedRange, loaded_ranges};
pub use stack::{CallGraph, Depth};
pub use thumb_decode::Effect;

/// The result of reading a program. An error says what is missing or cannot be analyzed.
pub type ReadResult<T> = Result<T, Box<dyn Error>>;
