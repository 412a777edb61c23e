//! Programs made of Blockly's blocks for an arm. This crate needs no browser, arm or clock, and does no input or output.
//!
//! ```text
//!   JSON of Blockly's workspace ──▶ Program ──▶ python: the same program for the package `sevenbot`
//!                                      │
//!                                      └──▶ Code ──▶ Interpreter ──▶ ProgramEvent: a block begins, a command, a sensor
//!                                                        ▲                                    │
//!                                                        └──────────── value of the sensor ───┘
//! ```
//!
//! [`Interpreter::advance`] never loops for long: each iteration of a loop and each call of a function is an event. So the caller
//! decides how much of an endless program runs at a time.

#![forbid(unsafe_code)]

mod code;
mod command;
mod compile;
mod fault;
mod interpreter;
mod json;
mod names;
mod parse;
mod program;
mod python;
mod value;

pub use command::{Axis, LINE_SPEEDS, ProgramCommand, Sensor};
pub use fault::{BlockId, ProgramError, ProgramFault, Quantity};
pub use interpreter::{Interpreter, MOST_CALLS, ProgramEvent};
pub use program::Program;
pub use python::python;
pub use value::Value;
