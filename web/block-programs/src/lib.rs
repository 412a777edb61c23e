//! Programs of Blockly's blocks for an arm: without a browser, an arm, input or output, or a clock.
//!
//! ```text
//!   JSON of Blockly's workspace ──▶ Program ──▶ python: the same program for the package `sevenbot`
//!                                      │
//!                                      └──▶ Code ──▶ Interpreter ──▶ Event: a block begins, a command, a sensor
//!                                                        ▲                                    │
//!                                                        └──────────── value of the sensor ───┘
//! ```
//!
//! [`Interpreter::advance`] never loops for long: each round of a loop and each call of a function is an event. So whoever runs
//! an endless program decides how much of it runs at a time.

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

pub use command::{Axis, Command, LINE_SPEEDS, Sensor};
pub use fault::{BlockId, ProgramError, ProgramFault, Quantity};
pub use interpreter::{Event, Interpreter, MOST_CALLS};
pub use program::Program;
pub use python::python;
pub use value::Value;
