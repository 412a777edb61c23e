//! Tests of the built simulator, in one program.

#![allow(clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

mod command_line;
mod real_servos;
mod servos_only;
mod session;
mod sim;
