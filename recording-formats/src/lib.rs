//! Recordings of movements in the formats of other programs.
//!
//! ```text
//!   text  ┐                                        ┌─▶ text   `sevenbot play`
//!   CSV   ┼─▶ read ──▶ Recording ──▶ write ────────┼─▶ CSV    spreadsheets, plot programs
//!   MCAP  ┘                                        └─▶ MCAP   Rerun, ROS 2
//!                      an arm ──▶ McapWriter ────────▶        the same, while it moves
//! ```
//!
//! The topics of an MCAP file are named as in `ros/sevenbot_ros`; `/vacuum` is an addition. Its angles are in radians, and it is
//! not compressed.
//!
//! ```
//! use recording_formats::{Format, read, write};
//!
//! let text = "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n1 120 90 65 90 90 90 80 0\n";
//! let recording = read(text.as_bytes())?;
//! let mut mcap = Vec::new();
//! write(&recording, Format::Mcap, &mut mcap)?;
//! assert!(read(mcap.as_slice())?.moments().eq(recording.moments()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod cdr;
mod convert;
mod csv;
mod diagnosis;
mod format;
mod joints;
mod mcap_reader;
mod messages;
mod read;
mod read_error;
mod telemetry;
mod topics;
mod write;
mod writer;

pub use convert::convert;
pub use format::Format;
pub use read::read;
pub use read_error::{McapReadError, ReadError};
pub use telemetry::{JointMotion, Telemetry};
pub use write::write;
pub use writer::{McapLayout, McapWriter};
