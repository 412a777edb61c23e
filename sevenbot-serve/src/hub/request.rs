//! A whole request of a client, with its values.

use protocol_core::registers::Map;
use protocol_core::wire::{Frame, Function, MIN_LENGTH};

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
        /// The map that the write is in (M1).
        map: Map,
        /// The first register.
        address: u8,
        /// One byte per register, at most 255.
        values: Vec<u8>,
    },
    /// Writes between two reads of the same registers, to find out what they change. No other client's request comes
    /// between them. Gives two events.
    WritesBetweenReads {
        /// The map that the writes are in (M1).
        map: Map,
        /// The first register of each write, and one byte per register, at most 255.
        writes: Vec<(u8, Vec<u8>)>,
        /// The first register of the reads, and how many.
        read: (u8, u8),
    },
}

impl WholeRequest {
    /// The request in a frame of a client.
    #[must_use]
    pub fn from_frame(frame: Frame<'_>) -> Self {
        let (address, count) = (frame.address, frame.count);
        let write = |map| Self::Write { map, address, values: frame.data.to_vec() };
        match frame.function {
            Function::Read => Self::Read { address, count },
            Function::WriteMap21 => write(Map::V21),
            _ => write(Map::V22),
        }
    }

    /// Bytes that the request and its reply take on the line.
    pub(crate) fn line_bytes(&self) -> usize {
        match self {
            Self::Read { count, .. } => read_bytes(*count),
            Self::Write { values, .. } => MIN_LENGTH + values.len(),
            Self::WritesBetweenReads { writes, read: (_, count), .. } => {
                let writes: usize = writes.iter().map(|(_, values)| MIN_LENGTH + values.len()).sum();
                writes + 2 * read_bytes(*count)
            }
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
