//! Motion control of a 7Bot V2 arm: executes the requests of a host with seven servos.
//!
//! ```text
//!   host bytes ──▶ HostPort ──▶ ArmControl ──▶ Joints: Drive, Trajectory ──▶ calibration ──▶ Bus ──▶ servo bytes
//!                                  │  ▲         Joints: PositionFilter   ◀── calibration ◀── Bus ◀── servo bytes
//!                                  │  └── BusScheduler selects the next frame of the Bus
//!   host bytes ◀── HostPort ◀── registers ◀── Joints, Status
//!                                  │
//!                                  ▼ VacuumControl, settings to save
//! ```
//!
//! [`Controller`] combines all parts: bytes in, `poll`, outputs out. Firmware and simulator run the same controller in
//! different shells. The crate uses no clock, hardware, heap or log. It has no unsafe code and no path to a panic.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod arm_control;
mod bus_scheduler;
pub mod calibration;
mod config;
pub mod controller;
pub mod drive;
mod goal_check;
mod host_port;
mod host_watchdog;
mod joint_state;
mod joints;
mod let_go;
mod limit_check;
pub mod limits;
pub mod motor_state;
mod obstacle;
pub mod point_stream;
pub mod position_filter;
pub mod push_limiter;
pub mod reach;
pub mod report_timer;
mod reports;
pub mod servo_bus;
mod status;
mod supply_watch;
mod torque_check;
pub mod trajectory;
pub mod vacuum;

use protocol_core::time::Duration;

pub use config::Config;
pub use controller::{Controller, Output};
pub use protocol_core::settings::Storage;
pub use servo_bus::TorqueCodes;
pub use vacuum::Vacuum;

/// The control cycle: every 10 ms each driven joint gets a new goal and each servo is read once.
pub const CYCLE: Duration = Duration::from_millis(10);
