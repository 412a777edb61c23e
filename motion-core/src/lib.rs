//! Motion control of a 7Bot V2 arm: drives its seven servos as a host requests.
//!
//! ```text
//!   host bytes ──▶ HostPort ──▶ ArmControl ──▶ Joints: Drive, Trajectory ──▶ calibration ──▶ Bus ──▶ servo bytes
//!                                  │  ▲         Joints: PositionFilter   ◀── calibration ◀── Bus ◀── servo bytes
//!                                  │  └── BusScheduler selects the next frame of the Bus
//!   host bytes ◀── HostPort ◀── registers ◀── Joints, ControllerStatus
//!                                  │
//!                                  ▼ VacuumControl, settings to save
//! ```
//!
//! [`Controller`] combines all parts: bytes in, `poll`, outputs out. Firmware and simulator run the same controller in
//! different shells. The crate uses no clock, hardware, heap or log. It has no unsafe code and no path to a panic.
//!
//! ```
//! use motion_core::{Config, Controller, Output, Storage, TorqueCodes};
//! use protocol_core::time::{Duration, Instant};
//!
//! let config = Config {
//!     chip_id: *b"EXAMPL",
//!     faults: 0,
//!     servo_baud: 1_000_000,
//!     servo_timeout: Duration::from_millis(3),
//!     guard_time: Duration::from_micros(100),
//!     torque_codes: TorqueCodes::default(),
//! };
//! let now = Instant::ZERO;
//! let mut arm = Controller::new(now, config, None, Storage::Ready);
//!
//! // The host reads its seven targets, registers 46 to 52.
//! let request = [0xAA, 0x77, 3, 46, 7, 0x8B, 0xCE];
//! assert_eq!(arm.host_bytes(now, &request), request.len());
//! let mut to_host = Vec::new();
//! let due = loop {
//!     match arm.poll(now, 262) {
//!         Output::ToHost(bytes) => to_host.extend_from_slice(bytes),
//!         Output::ToServos(frame) => println!("on the servo bus: {frame:02x?}"),
//!         Output::Vacuum(vacuum) => println!("pump and valve: {vacuum:?}"),
//!         Output::Save(_) => arm.set_storage(Storage::Ready),
//!         Output::Wait(due) => break due,
//!     }
//! };
//! assert_eq!(to_host, [0xAA, 0x77, 3, 46, 7, 90, 90, 65, 90, 90, 90, 80, 0xE9, 0x81]);
//! // The shell calls `poll` again at this time, or when bytes come.
//! assert!(due > now);
//! ```

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

/// The control cycle: every 10 ms the driven joints get new goals, and the servos that answer are read.
pub const CYCLE: Duration = Duration::from_millis(10);
