//! What a 7Bot V2 arm and its host say to each other, and what the arm remembers.
//!
//! ```text
//!   bytes ──▶ wire::Deframer ──▶ wire::Frame ──▶ request::Request ──▶ registers::RegisterFile
//!                                                                          │        │
//!   bytes ◀── wire::Frame ◀──────────────────── request::Reply ◀───────────┘        ▼
//!                                                                         Image ──▶ journal::Journal
//! ```
//!
//! Firmware, simulator and host tools share this crate, so the two ends of the wire cannot drift apart.
//! It refuses to know clocks, hardware, heaps and logs: time is handed in ([`time`]), bytes are handed in
//! and out, and every operation returns what happened. It has no unsafe code and no path to a panic.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod chip_id;
pub mod journal;
pub mod registers;
pub mod request;
pub mod time;
pub mod wire;
