//! A whole request of a client, with its values.

use protocol_core::registers::Map;
use protocol_core::registers::map::{DEVICE_ID, GRIP_LIMIT};
use protocol_core::wire::{Frame, Function, MIN_LENGTH};

/// A request that owns its values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WholeRequest {
    /// Reads `count` registers from `address` on.
    Read {
        /// The first register.
        address: u8,
        /// How many registers, one byte each.
        count: u8,
    },
    /// Writes registers from `address` on.
    Write {
        /// The map that the write is in ([M1](protocol_core::decisions#m1)).
        map: Map,
        /// The first register.
        address: u8,
        /// One byte per register, at most 255.
        values: Vec<u8>,
    },
    /// Writes between two reads of the same registers, to find out what the writes change. No other client's request comes
    /// between them. Gives two events.
    WritesBetweenReads {
        /// The map that the writes are in ([M1](protocol_core::decisions#m1)).
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

/// Removes from both ends of a write the registers on which no write has an effect ([D15](protocol_core::decisions#d15)). The
/// longest frame then takes 17 ms at 115 200 baud instead of 23. A stop has to wait for a frame that is being sent.
pub(crate) fn without_idle_ends(address: u8, values: &[u8]) -> (u8, &[u8]) {
    let is_idle = |place: usize| {
        let register = usize::from(address) + place;
        register < usize::from(DEVICE_ID.address)
            || register >= usize::from(GRIP_LIMIT.address + GRIP_LIMIT.count)
    };
    let Some(first) = (0..values.len()).find(|&place| !is_idle(place)) else { return (address, &[]) };
    let last = (0..values.len()).rfind(|&place| !is_idle(place)).unwrap_or(first);
    let start = u8::try_from(usize::from(address) + first).unwrap_or(address);
    (start, values.get(first..=last).unwrap_or_default())
}

/// Bytes that a read of `count` registers and its reply take on the line.
pub(crate) fn read_bytes(count: u8) -> usize {
    MIN_LENGTH + reply_bytes(count)
}

/// Bytes of the reply with `count` registers.
pub(crate) fn reply_bytes(count: u8) -> usize {
    MIN_LENGTH + usize::from(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_without_effect_at_the_ends_of_a_write_are_not_sent() {
        let values = [7; 255];
        assert_eq!(without_idle_ends(0, &values), (11, &values[11..195]));
        assert_eq!(without_idle_ends(46, &values[..7]), (46, &values[..7]));
        assert_eq!(without_idle_ends(8, &values[..4]), (11, &values[..1]));
        assert_eq!(without_idle_ends(232, &values[..8]), (232, &[][..]));
        assert_eq!(without_idle_ends(0, &[]), (0, &[][..]));
    }
}
