//! The servo bus without an arm's controller: for who builds or repairs an arm.
//!
//! ```text
//!   scan, facts, id, center ──▶ BusMaster ──▶ ServoLine ──▶ half-duplex adapter ──▶ servos
//!                                  │
//!                                  └── frames of motion-core, which the arm's controller uses too
//! ```
//!
//! Talks to SCS servos directly, through a half-duplex TTL adapter. Two masters must never share one bus: the arm's
//! controller has to be off the bus, or off. Everything blocks, with timeouts.
//!
//! ```no_run
//! use sevenbot::servo_bench::{BusOptions, BusMaster, servo_info::ServoInfo};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut bus = BusMaster::open("/dev/ttyUSB0", 1_000_000, BusOptions::default())?;
//! println!("{:?}", ServoInfo::read(&mut bus, 0)?);
//! # Ok(())
//! # }
//! ```

pub mod bus_master;
pub mod center;
pub mod error;
pub mod scan;
pub mod servo_info;
pub mod servo_line;
pub mod set_id;
#[cfg(test)]
mod simulated;
#[cfg(test)]
mod tests;

pub use bus_master::{BusMaster, BusOptions, ServoReply};
pub use error::ServoError;
pub use motion_core::servo_bus::frame::{BAUD_RATES, register};
pub use motion_core::servo_bus::{Reading, Torque, TorqueCodes};
pub use servo_line::ServoLine;

/// The highest id that a servo can have.
pub const MAX_ID: u8 = 253;
