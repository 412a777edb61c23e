//! What a 7Bot V2 arm does about what its host says.
//!
//! ```text
//!   host bytes ──▶ Controller ──▶ Arm ──▶ Drive, Trajectory ──▶ calibration ──▶ Bus ──▶ servo bytes
//!   host bytes ◀──     │      ◀── Arm ◀── Sensor          ◀── calibration ◀── Bus ◀── servo bytes
//!                      ▼
//!            vacuum, settings to save
//! ```
//!
//! Firmware and simulator run the same [`Controller`]; only what stands round it differs. It refuses to
//! know clocks, hardware, heaps and logs, has no unsafe code and no path to a panic.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod arm;
pub mod calibration;
pub mod controller;
pub mod drive;
pub mod feedback;
pub mod mode;
pub mod sensor;
pub mod servo_bus;
pub mod trajectory;
pub mod vacuum;

use protocol_core::time::Duration;

pub use controller::{Config, Controller, Output, Storage};
pub use servo_bus::TorqueCodes;
pub use vacuum::Vacuum;

/// The control cycle: every 10 ms each driven joint gets a new goal and each servo is asked once.
pub const CYCLE: Duration = Duration::from_millis(10);
