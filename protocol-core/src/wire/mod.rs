//! The layout of a frame on the line, and the search for frames in a stream of bytes.
//!
//! ```text
//!     0    1    2      3     4      5 ..            5+n   6+n
//!   ┌────┬────┬────┬──────┬───────┬───────────────┬─────┬─────┐
//!   │ AA │ 77 │ fn │ addr │ count │ n data bytes  │ CRC │ CRC │
//!   └────┴────┴────┴──────┴───────┴───────────────┴─────┴─────┘
//!    header         first   number  n = 0 in a      low   high
//!                  register  of     read request,   over all bytes before it
//!                         registers else count
//! ```
//!
//! Function 03 is a read, 06 a write in map 2.2, 04 a write in map 2.1. A reply has the function, address and count of its
//! request. A report has function 03, or 05 in map 2.1. An alarm, 08, has a level and a kind in place of address and
//! count, and no data. This module does not know the registers: an address is a number here.

pub mod crc;
pub mod deframer;
pub mod frame;
mod search;

pub use deframer::Deframer;
pub use frame::{
    Defect, Direction, Frame, FrameBuffer, Function, MAX_LENGTH, MIN_LENGTH, ParseOutcome, ToArm, ToHost,
};
