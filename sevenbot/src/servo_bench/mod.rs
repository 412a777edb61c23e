//! Single servos without the arm's controller, for building and repairing an arm.
//!
//! ```text
//!   scan, servo_info, register_access, set_id, center ─▶ BusMaster ──▶ ServoLine ──▶ half-duplex adapter ──▶ servos
//!                                                            │
//!                                                            └── frames of motion-core, as in the arm's controller
//! ```
//!
//! Talks to SCS servos through a half-duplex TTL adapter. Disconnect the arm's controller from the bus first: two
//! masters must not share one bus. Exchanges block, with timeouts.
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
pub mod register_access;
pub mod register_table;
pub mod scan;
pub mod servo_info;
pub mod servo_line;
pub mod set_id;
#[cfg(test)]
mod tests;

pub use bus_master::{BusMaster, BusOptions, ServoReply};
pub use error::ServoError;
pub use motion_core::servo_bus::frame::{BAUD_RATES, register};
pub use motion_core::servo_bus::{Reading, Torque, TorqueCodes};
pub use servo_line::ServoLine;

/// The highest id that a servo can have.
pub const MAX_ID: u8 = 253;
