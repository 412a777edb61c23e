//! A 7Bot V2 arm in a terminal: the firmware's own controller, with a pseudo-terminal for the host's end and
//! seven simulated servos for the arm's.
//!
//! ```text
//!              shell (clock, file descriptors, signals)
//!   ┌──────────────────────────────────────────────────────────────────────┐
//!   │        World (time is a number)                                      │
//!   │  pty  ┌────────────────────────────────────────────────────────────┐ │
//!  ═╪═════▶ │ pace ──▶ motion_core::Controller ──▶ bytes ──▶ Plant       │ │
//!  ═╪═◀════ │ pace ◀──     │                   ◀── bytes ◀── 7 × Servo   │ │
//!   │       └──────────────┼─────────────────────────────────────────────┘ │
//!   │                      ▼ protocol_core::journal ──▶ flash ──▶ a file   │
//!   └──────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! One shell carries any number of worlds: see [`shell`] and [`arm`].
//!
//! Everything but the chip is the real thing. [`world`] knows neither clocks nor file descriptors, so a
//! test can run it through an hour in a second. Linux only: presence of a client is seen through inotify.

#![deny(unsafe_code)]

pub mod arm;
pub mod bus_line;
pub mod bus_statistics;
pub mod cli;
pub mod clients;
pub mod clock;
pub mod eeprom;
mod holders;
pub mod image_file;
pub mod link;
pub mod numbered;
pub mod pty;
pub mod real_servos;
pub mod serial;
pub mod servo_socket;
pub mod servos_only;
pub mod shell;
pub mod signals;
pub mod trace;
