//! The system tests, in one program; only the table of commands and faults has its own. A filter selects a module:
//! `cargo test -p system-tests --test system device::motion`.

mod device;
mod serve;
mod simulator;
mod support;
mod tool;
