//! Requests and replies, for both ends of the wire, so that the arm and the host tools use the same definitions.
//!
//! ```text
//!   host                                   arm
//!   Request::encode ──▶ Frame ──▶ Request::from_frame
//!   Reply::from_frame ◀── Frame ◀── Reply::encode
//!   ReportMap21, Alarm ◀─ Frame ◀── without a request
//! ```
//!
//! This file knows neither streams of bytes nor the meaning of registers.

use crate::wire::frame::{self, Frame, FrameBuffer, Function};

/// What one frame from the host asks for. The values are borrowed.
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
    /// Writes the registers of map 2.2 from `address` on.
    Write {
        /// The first register.
        address: u8,
        /// One byte per register, at most 255.
        values: &'a [u8],
    },
    /// Writes the registers of map 2.1 from `address` on ([M1](crate::decisions#m1)).
    WriteMap21 {
        /// The first register.
        address: u8,
        /// One byte per register, at most 255.
        values: &'a [u8],
    },
}

impl<'a> Request<'a> {
    /// The request in a frame in direction [`ToArm`](crate::wire::ToArm). Frames of the functions that only an arm sends
    /// count as reads.
    #[must_use]
    pub const fn from_frame(frame: Frame<'a>) -> Self {
        match frame.function {
            Function::Write => Self::Write { address: frame.address, values: frame.data },
            Function::WriteMap21 => Self::WriteMap21 { address: frame.address, values: frame.data },
            Function::Read | Function::Report | Function::Alarm => {
                Self::Read { address: frame.address, count: frame.count }
            }
        }
    }

    /// Encodes the request into `buffer`, replacing its content. Values are cut to 255.
    pub fn encode(&self, buffer: &mut FrameBuffer) {
        match *self {
            Self::Read { address, count } => frame::encode(buffer, Function::Read, address, count, &[]),
            Self::Write { address, values } => encode_values(buffer, Function::Write, address, values),
            Self::WriteMap21 { address, values } => {
                encode_values(buffer, Function::WriteMap21, address, values);
            }
        }
    }
}

/// The reply of the arm to a read. A report of register 53 has the same form ([D14](crate::decisions#d14)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reply<'a> {
    /// The first register.
    pub address: u8,
    /// The values, one byte per register, at most 255.
    pub values: &'a [u8],
}

impl<'a> Reply<'a> {
    /// The reply, or the report of map 2.2, in a frame that the host received; `None` for any other frame.
    #[must_use]
    pub const fn from_frame(frame: Frame<'a>) -> Option<Self> {
        match frame.function {
            Function::Read => Some(Self { address: frame.address, values: frame.data }),
            _ => None,
        }
    }

    /// Encodes the reply into `buffer`, replacing its content. Values are cut to 255.
    pub fn encode(&self, buffer: &mut FrameBuffer) {
        encode_values(buffer, Function::Read, self.address, self.values);
    }
}

/// A report in map 2.1, which the arm sends without a request ([M4](crate::decisions#m4)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReportMap21<'a> {
    /// The first register.
    pub address: u8,
    /// The values, one byte per register, at most 255.
    pub values: &'a [u8],
}

impl<'a> ReportMap21<'a> {
    /// The report of map 2.1 in a frame that the host received; `None` for any other frame, also for a report of map 2.2.
    #[must_use]
    pub const fn from_frame(frame: Frame<'a>) -> Option<Self> {
        match frame.function {
            Function::Report => Some(Self { address: frame.address, values: frame.data }),
            _ => None,
        }
    }

    /// Encodes the report into `buffer`, replacing its content. Values are cut to 255.
    pub fn encode(&self, buffer: &mut FrameBuffer) {
        encode_values(buffer, Function::Report, self.address, self.values);
    }
}

/// An alarm, which the arm sends without a request, if register 20 allows it ([M6](crate::decisions#m6),
/// [M8](crate::decisions#m8)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Alarm {
    /// 0: message. 1: warning. 2: fatal.
    pub level: u8,
    /// Which inverse kinematics has no solution: 5 is IK5, 6 is IK6, 7 is IK7.
    pub kind: u8,
}

impl Alarm {
    /// The warning that no joint angles reach a position. `kind` is 5, 6 or 7.
    #[must_use]
    pub const fn out_of_reach(kind: u8) -> Self {
        Self { level: 1, kind }
    }

    /// The alarm in a frame that the host received; `None` for any other frame.
    #[must_use]
    pub const fn from_frame(frame: Frame<'_>) -> Option<Self> {
        match frame.function {
            Function::Alarm => Some(Self { level: frame.address, kind: frame.count }),
            _ => None,
        }
    }

    /// Encodes the alarm into `buffer`, replacing its content.
    pub fn encode(&self, buffer: &mut FrameBuffer) {
        frame::encode(buffer, Function::Alarm, self.level, self.kind, &[]);
    }
}

fn encode_values(buffer: &mut FrameBuffer, function: Function, address: u8, values: &[u8]) {
    // `frame::encode` cuts the data to 255 bytes, too.
    let count = u8::try_from(values.len()).unwrap_or(u8::MAX);
    frame::encode(buffer, function, address, count, values);
}
