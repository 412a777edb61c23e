//! The envelope: what a frame looks like on the line, and how frames are found in a stream of bytes.
//!
//! ```text
//!     0    1    2      3     4      5 ..            5+n   6+n
//!   ┌────┬────┬────┬──────┬───────┬───────────────┬─────┬─────┐
//!   │ AA │ 77 │ fn │ addr │ count │ n data bytes  │ CRC │ CRC │
//!   └────┴────┴────┴──────┴───────┴───────────────┴─────┴─────┘
//!    header         first   how     n = 0 in a      low   high
//!                  register many    read request,   over every byte before
//!                                   else count
//! ```
//!
//! Function 03 is a read, 06 a write. A reply has the function, address and count of its request. Knows
//! nothing of registers: an address here is a number.

pub mod crc;
pub mod deframer;
pub mod frame;
mod search;

pub use deframer::Deframer;
pub use frame::{Defect, Direction, Frame, FrameBuffer, Function, MAX_LENGTH, ToArm, ToHost};
