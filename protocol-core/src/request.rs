//! What a frame asks for and what is answered: both ends of the wire in one place, so that the arm and its
//! host tools cannot drift apart.
//!
//! ```text
//!   host                                   arm
//!   Request::encode ──▶ Frame ──▶ Request::from_frame
//!   Reply::from_frame ◀── Frame ◀── Reply::encode
//! ```
//!
//! Knows nothing of what a register means, nor of streams.

use crate::wire::frame::{self, Frame, FrameBuffer, Function};

/// What the host asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// The values of `count` registers from `address` on.
    Read {
        /// The first register.
        address: u8,
        /// How many; 0 is answered with no values.
        count: u8,
    },
    /// New values for the registers from `address` on.
    Write {
        /// The first register.
        address: u8,
        /// One byte a register, at most 255 of them.
        values: &'a [u8],
    },
}

impl<'a> Request<'a> {
    /// What a frame that came to the arm asks for.
    #[must_use]
    pub const fn from_frame(frame: Frame<'a>) -> Self {
        match frame.function {
            Function::Read => Self::Read { address: frame.address, count: frame.count },
            Function::Write => Self::Write { address: frame.address, values: frame.data },
        }
    }

    /// Writes the request's frame into `buffer`, over whatever was there. Values past the 255th are cut off.
    pub fn encode(&self, buffer: &mut FrameBuffer) {
        match *self {
            Self::Read { address, count } => frame::encode(buffer, Function::Read, address, count, &[]),
            Self::Write { address, values } => encode_values(buffer, Function::Write, address, values),
        }
    }
}

/// What the arm answers to a read. The same frame, unasked, reports the present positions (D14).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reply<'a> {
    /// The first register.
    pub address: u8,
    /// Their values, one byte a register, at most 255 of them.
    pub values: &'a [u8],
}

impl<'a> Reply<'a> {
    /// The reply in a frame that came to the host; `None` for a write, which no arm sends.
    #[must_use]
    pub const fn from_frame(frame: Frame<'a>) -> Option<Self> {
        match frame.function {
            Function::Read => Some(Self { address: frame.address, values: frame.data }),
            Function::Write => None,
        }
    }

    /// Writes the reply's frame into `buffer`, over whatever was there. Values past the 255th are cut off.
    pub fn encode(&self, buffer: &mut FrameBuffer) {
        encode_values(buffer, Function::Read, self.address, self.values);
    }
}

fn encode_values(buffer: &mut FrameBuffer, function: Function, address: u8, values: &[u8]) {
    let values = values.get(..255).unwrap_or(values);
    let count = u8::try_from(values.len()).unwrap_or(u8::MAX);
    frame::encode(buffer, function, address, count, values);
}
