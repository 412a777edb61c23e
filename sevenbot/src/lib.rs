//! Connects to a 7Bot V2 arm: over its serial port, through a server, or in a simulation.
//!
//! ```text
//!   Arm ── read, write, typed values ──▶ HostLink ──▶ serial port ──▶ arm, simulator, or emulated firmware
//!    ▲                                      │
//!    ├── replies ◀── matched in order ──────┤
//!    └── reports ◀── sent by the arm (D14) ─┘
//! ```
//!
//! Calls of [`Arm`] block, with timeouts. Frames and the register table come from `protocol-core`, which this project's firmware
//! uses too.
//! `D1` to `D30` are rules in `docs/protocol.md`. The library sends targets; the arm plans the motion.
//!
//! ```no_run
//! use sevenbot::{Angle, Arm, Joint};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut arm = Arm::open("/dev/ttyUSB0", 115_200)?;
//! println!("firmware {}", arm.identity().version());
//! if let (Some(base), Some(angle)) = (Joint::new(1), Angle::from_degrees(120)) {
//!     arm.set_target(base, angle)?;
//! }
//! println!("{:?}", arm.positions()?);
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

#[cfg(feature = "serial")]
pub mod advice;
pub mod approach;
pub mod arm;
mod arm_options;
mod arm_values;
mod blocking_link;
pub mod cartesian;
pub mod checked_write;
pub mod error;
pub mod fine;
pub mod fine_angle;
mod fine_state;
pub mod health;
pub mod hold;
pub mod host_line;
pub mod identity;
pub mod joints;
mod map21_text;
mod map_view;
pub mod movement_run;
pub mod moves;
pub mod names;
#[cfg(feature = "serial")]
pub mod network;
#[cfg(feature = "serial")]
pub mod open_port;
pub mod park_poses;
#[cfg(feature = "serial")]
mod permission;
pub mod playback;
pub mod point_path;
#[cfg(feature = "serial")]
pub mod ports;
mod real_time_line;
pub mod recording;
pub mod register_text;
pub mod register_values;
mod reports;
#[cfg(feature = "serial")]
pub mod servo_bench;
pub mod simulated;
pub mod simulated_arms;
pub mod status_block;
pub mod stream;
pub mod table;
pub mod traffic;
mod traffic_text;
pub mod units;
pub mod whole_file;
pub mod wire_log;

pub use arm::Arm;
pub use arm_options::ArmOptions;
pub use error::{Error, OpenError, PortError, ReceiveCounts};
pub use fine_angle::FineAngle;
pub use health::{Health, Problem, ProblemKind};
pub use host_link::{Snapshot, Span};
pub use identity::{Firmware, Identity};
pub use protocol_core::registers::map21::Map;
pub use protocol_core::registers::{Joint, Range, Register, map, map21};
pub use reports::Report;
pub use status_block::StatusBlock;
pub use units::{Angle, MoveTime, Speed};

/// Runs the Rust block of a page as a documentation test.
#[cfg(doctest)]
#[doc = include_str!("../../docs/simulation.md")]
struct SimulationPage;
