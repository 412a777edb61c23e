//! The simulator: 7Bot V2 arms on pseudo-terminals, or the controller on this computer with real servos.
//!
//! ```text
//!             EventLoop: clock, file descriptors, signals
//!            ┌───────────────────────────────────────────────────────┐
//!            │ PtyArm ×N                                             │
//!  client ◀──▶ Pty ◀──▶ arm_sim::SimulatedArm: controller, servos    │
//!            │                    └─▶ Flash in an ImageFile          │
//!            └───────────────────────────────────────────────────────┘
//! ```
//!
//! `--servos` runs [`real_servos`] instead: one arm whose servo bus is a serial port. `--servos-only` and
//! `--servo-socket` run the simulated servos without a controller.
//!
//! The crate runs on Linux only, because inotify reports when clients open and close a pseudo-terminal.
//!
//! ```
//! use host_sim::control::request::{ControlRequest, parse};
//!
//! // A line of the control socket.
//! assert_eq!(parse(br#"{"do":"advance","ms":250}"#), Ok(ControlRequest::Advance { ms: 250 }));
//! assert!(parse(b"advance 250").is_err());
//! ```

#![deny(unsafe_code)]

pub mod angle_log;
pub mod bus_line;
pub mod bus_statistics;
pub mod cli;
pub mod clock;
pub mod control;
pub mod eeprom;
pub mod event_loop;
mod help;
pub mod image_file;
pub mod per_arm;
pub mod private_socket;
pub mod pty_arm;
pub mod real_servos;
pub mod servo_socket;
pub mod servos_only;
pub mod session_file;
pub mod signals;
pub mod snapshots;
pub mod trace;
pub mod virtual_clock;
