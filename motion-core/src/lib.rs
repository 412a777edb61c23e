//! What a 7Bot V2 arm does about what its host says.
//!
//! ```text
//!   host bytes ──▶ Controller ──▶ Trajectory ──▶ calibration ──▶ servo_bus ──▶ servo bytes
//!   host bytes ◀──     │     ◀──────────────────  calibration ◀── servo_bus ◀── servo bytes
//!                      ▼
//!              vacuum, settings to save
//! ```
//!
//! Firmware and simulator run the same [`Controller`]; only what stands round it differs. It refuses to
//! know clocks, hardware, heaps and logs, has no unsafe code and no path to a panic.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod calibration;
pub mod controller;
pub mod servo_bus;

pub use controller::{Config, Controller, Output, Storage, TorqueCodes, Vacuum};
