//! The protocol between a 7Bot V2 arm and its host, and the settings that the arm stores.
//!
//! ```text
//!   bytes ──▶ wire::Deframer ──▶ wire::Frame ──▶ request::Request ──▶ registers::RegisterFile
//!                                                                          │        │
//!   bytes ◀── wire::Frame ◀──────────────────── request::Reply ◀───────────┘        ▼
//!                                                                         Image ──▶ settings::Settings ──▶ journal::Journal
//! ```
//!
//! Firmware, simulator and host tools share this crate, so both ends of the wire use the same definitions. The crate uses
//! no clock, hardware, heap or log: time ([`time`]) and bytes are arguments, and every operation returns its result. It
//! has no unsafe code and no path to a panic.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod chip_id;
pub mod journal;
pub mod registers;
pub mod request;
pub mod settings;
pub mod time;
pub mod wire;
