//! A simulated 7Bot V2 arm: the firmware's own controller, and seven simulated servos under the weight of the arm.
//!
//! ```text
//!           World: time is an argument
//!          ┌─────────────────────────────────────────────────────────────┐
//!   bytes ─▶ Pacer ──▶ motion_core::Controller ──▶ bytes ──▶ Plant:      │
//!   bytes ◀─ Pacer ◀──     │                   ◀── bytes ◀── 7 × Servo   │
//!          │               └─▶ Settings: the journal on a Flash          │
//!          └─────────────────────────────────────────────────────────────┘
//! ```
//!
//! The crate uses no operating system: it has no clock, file or thread, and it runs in a browser. The same calls give
//! the same bytes on every machine.

#![forbid(unsafe_code)]

pub mod adapter;
pub mod faults;
pub mod flash;
pub mod pace;
pub mod plant;
pub mod servo;
pub mod servo_bus;
mod settings_log;
pub mod world;
