//! Requests and replies, for both ends of the wire, so that the arm and the host tools use the same definitions.
//!
//! ```text
//!   host                                   arm
//!   Request::encode ──▶ Frame ──▶ Request::from_frame
//!   Reply::from_frame ◀── Frame ◀── Reply::encode
//! ```
//!
//! This file does not know the meaning of registers, or streams.

use crate::wire::frame::{self, Frame, FrameBuffer, Function};

/// A request of the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// Reads `count` registers from `address` on.
    Read {
        /// The first register.
        address: u8,
        /// How many registers; 0 gives a reply without values.
        count: u8,
    },
    /// Writes the registers from `address` on.
    Write {
        /// The first register.
        address: u8,
        /// One byte per register, at most 255.
        values: &'a [u8],
    },
}

impl<'a> Request<'a> {
    /// The request in a frame that the arm received.
    #[must_use]
    pub const fn from_frame(frame: Frame<'a>) -> Self {
        match frame.function {
            Function::Read => Self::Read { address: frame.address, count: frame.count },
            Function::Write => Self::Write { address: frame.address, values: frame.data },
        }
    }

    /// Encodes the request into `buffer`, replacing its content. Values are cut to 255.
    pub fn encode(&self, buffer: &mut FrameBuffer) {
        match *self {
            Self::Read { address, count } => frame::encode(buffer, Function::Read, address, count, &[]),
            Self::Write { address, values } => encode_values(buffer, Function::Write, address, values),
        }
    }
}

/// The reply of the arm to a read. A report of the present positions has the same form (D14).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reply<'a> {
    /// The first register.
    pub address: u8,
    /// The values, one byte per register, at most 255.
    pub values: &'a [u8],
}

impl<'a> Reply<'a> {
    /// The reply in a frame that the host received; `None` for a write, which an arm never sends.
    #[must_use]
    pub const fn from_frame(frame: Frame<'a>) -> Option<Self> {
        match frame.function {
            Function::Read => Some(Self { address: frame.address, values: frame.data }),
            Function::Write => None,
        }
    }

    /// Encodes the reply into `buffer`, replacing its content. Values are cut to 255.
    pub fn encode(&self, buffer: &mut FrameBuffer) {
        encode_values(buffer, Function::Read, self.address, self.values);
    }
}

fn encode_values(buffer: &mut FrameBuffer, function: Function, address: u8, values: &[u8]) {
    // `frame::encode` cuts the data to 255 bytes, too.
    let count = u8::try_from(values.len()).unwrap_or(u8::MAX);
    frame::encode(buffer, function, address, count, values);
}
