//! A whole request of a client, with its values.

use protocol_core::request::Request;
use protocol_core::wire::MIN_LENGTH;

/// A request that owns its values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WholeRequest {
    /// Reads `count` registers from `address` on.
    Read {
        /// The first register.
        address: u8,
        /// How many registers.
        count: u8,
    },
    /// Writes registers from `address` on.
    Write {
        /// The first register.
        address: u8,
        /// One byte per register, at most 255.
        values: Vec<u8>,
    },
}

impl WholeRequest {
    /// Bytes that the request and its reply take on the line.
    pub(crate) fn line_bytes(&self) -> usize {
        match self {
            Self::Read { count, .. } => read_bytes(*count),
            Self::Write { values, .. } => MIN_LENGTH + values.len(),
        }
    }
}

/// Bytes that a read of `count` registers and its reply take on the line.
pub(crate) fn read_bytes(count: u8) -> usize {
    MIN_LENGTH + reply_bytes(count)
}

/// Bytes of the reply with `count` registers.
pub(crate) fn reply_bytes(count: u8) -> usize {
    MIN_LENGTH + usize::from(count)
}

impl From<Request<'_>> for WholeRequest {
    fn from(request: Request<'_>) -> Self {
        match request {
            Request::Read { address, count } => Self::Read { address, count },
            Request::Write { address, values } => Self::Write { address, values: values.to_vec() },
        }
    }
}
