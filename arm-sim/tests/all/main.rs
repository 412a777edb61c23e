//! Tests of the public face of arm-sim, in one program.

#![allow(clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

mod disturbances;
mod gravity;
mod obstacles;
mod rig;
mod room;
mod servo_faults;
mod simulated_arm;
mod simulated_servos;
mod simulation;
#[cfg(feature = "serde")]
mod snapshot_bytes;
mod stock_arm;
