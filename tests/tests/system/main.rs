//! The system tests, in one program. A filter selects a module: `cargo test -p system-tests --test system device::motion`.

mod device;
mod serve;
mod simulator;
mod tool;
