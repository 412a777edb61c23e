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
//!
//! ```
//! use protocol_core::registers::RegisterFile;
//! use protocol_core::registers::map::TARGET_POSITION;
//! use protocol_core::request::Request;
//! use protocol_core::time::{Duration, Instant};
//! use protocol_core::wire::{Deframer, FrameBuffer, ToArm};
//!
//! // The host encodes a request.
//! let mut bytes = FrameBuffer::new();
//! let pose = [90, 90, 65, 90, 90, 90, 80];
//! Request::Write { address: TARGET_POSITION.address, values: &pose }.encode(&mut bytes);
//! assert_eq!(bytes.as_slice(), [0xAA, 0x77, 6, 46, 7, 90, 90, 65, 90, 90, 90, 80, 0xF9, 0x91]);
//!
//! // The arm finds the frame in the stream, checks the write, and applies it.
//! let mut deframer = Deframer::<ToArm>::new(Duration::from_millis(10));
//! deframer.push(Instant::ZERO, &bytes);
//! let Some(Ok(frame)) = deframer.pull() else { return Err("a frame") };
//! let Request::Write { address, values } = Request::from_frame(frame) else { return Err("a write") };
//! let mut registers = RegisterFile::new([0; 6], None);
//! let accepted = registers.check(address, values).map_err(|_| "in range")?;
//! registers.apply(&accepted);
//! assert_eq!(registers.get(48), 65);
//! assert!(registers.check(address, &[181]).is_err());
//! # Ok::<(), &str>(())
//! ```

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod chip_id;
pub mod decisions;
pub mod journal;
pub mod registers;
pub mod report_kind;
pub mod request;
pub mod settings;
pub mod time;
pub mod wire;
