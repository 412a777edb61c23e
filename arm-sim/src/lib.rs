//! A simulated 7Bot V2 arm: the controller of the firmware, and seven simulated servos under the weight of the arm.
//!
//! ```text
//!           SimulatedArm: time is an argument
//!          ┌───────────────────────────────────────────────────────────┐
//!   bytes ─▶ Pacer ──▶ motion_core::Controller ──▶ bytes ──▶ Plant:    │
//!   bytes ◀─ Pacer ◀──     │                   ◀── bytes ◀── 7 × Servo │
//!          │               └─▶ Settings: the journal on a Flash        │
//!          └───────────────────────────────────────────────────────────┘
//! ```
//!
//! [`Simulation`] is such an arm with a clock of its own: start there.
//!
//! The crate is `no_std`: it has no clock, file or thread, and it runs in a browser. The same calls give the same bytes
//! on every machine.
//!
//! ```
//! use arm_sim::request::Request;
//! use arm_sim::{Duration, Joint, Simulation};
//!
//! let mut arm = Simulation::default();
//! arm.advance(Duration::from_millis(500));
//! // Register 46 is the target of joint 1, in degrees.
//! arm.send_request(&Request::Write { address: 46, values: &[120] });
//! arm.advance(Duration::from_millis(3_000));
//! let millidegrees = arm.plant().angle(Joint::ALL[0]);
//! assert!(millidegrees.abs_diff(120_000) < 1_500, "{millidegrees}");
//! ```

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod action;
pub mod controller;
pub mod fault_count;
pub mod faults;
pub mod faulty_flash;
pub mod flash;
pub mod host_line;
pub mod pace;
pub mod parameters;
pub mod plant;
pub mod replay;
pub mod scene;
pub mod servo;
pub mod servo_bus;
pub mod session;
mod settings_log;
pub mod simulated_arm;
pub mod simulation;
#[cfg(feature = "serde")]
pub mod snapshot_bytes;
pub mod stock_controller;
pub mod tap;
mod thousandths;
pub mod usb_adapter;
pub mod world;

pub use action::Action;
pub use protocol_core::registers::Joint;
pub use protocol_core::request;
pub use protocol_core::time::{Duration, Instant};
pub use servo::ServoFault;
pub use simulation::{Simulation, SimulationConfig};
