//! Messages as bytes, in the encoding of ROS 2: a header of four bytes, which names the byte order, and CDR.
//!
//! ```text
//!   00 01 00 00   CDR, little-endian, and options, which may give the number of padding bytes at the end
//!   ...           the fields, each aligned to its size, counted from here
//! ```

use byteorder::{BigEndian, LittleEndian};
use serde::{Deserialize, Serialize};

const LITTLE_ENDIAN: [u8; 2] = [0, 1];
const BIG_ENDIAN: [u8; 2] = [0, 0];
const NO_OPTIONS: [u8; 2] = [0, 0];

/// Encodes a message in little-endian CDR, with its header.
pub(crate) fn encode(message: &impl Serialize) -> Result<Vec<u8>, cdr_encoding::Error> {
    let mut bytes = [LITTLE_ENDIAN, NO_OPTIONS].concat();
    bytes.extend(cdr_encoding::to_vec::<_, LittleEndian>(message)?);
    Ok(bytes)
}

/// Decodes a message; `None` if the bytes are not such a message.
pub(crate) fn decode<'a, M: Deserialize<'a>>(bytes: &'a [u8]) -> Option<M> {
    let (order, body) = bytes.split_first_chunk()?;
    let body = body.get(NO_OPTIONS.len()..)?;
    match *order {
        LITTLE_ENDIAN => Some(cdr_encoding::from_bytes::<M, LittleEndian>(body).ok()?.0),
        BIG_ENDIAN => Some(cdr_encoding::from_bytes::<M, BigEndian>(body).ok()?.0),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Header, JointStateMessage, Time};

    /// Two joints at 1.5 s. The lines: header, stamp, `frame_id`, names, number of positions, positions, velocities, efforts.
    const BYTES: &[&[u8]] = &[
        &[0, 1, 0, 0],
        &[1, 0, 0, 0, 0, 0x65, 0xCD, 0x1D],
        // A text begins with its length, which includes the 0 at its end. The next number is aligned.
        &[1, 0, 0, 0, 0, 0, 0, 0],
        &[2, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0, 3, 0, 0, 0, b'b', b'c', 0, 0],
        &[2, 0, 0, 0],
        &[0, 0, 0, 0, 0, 0, 0xF0, 0x3F, 0, 0, 0, 0, 0, 0, 0, 0xC0],
        &[0, 0, 0, 0],
        &[0, 0, 0, 0],
    ];

    fn state() -> JointStateMessage {
        JointStateMessage {
            header: Header { stamp: Time { sec: 1, nanosec: 500_000_000 }, frame_id: String::new() },
            name: vec!["a".to_owned(), "bc".to_owned()],
            position: vec![1.0, -2.0],
            velocity: Vec::new(),
            effort: Vec::new(),
        }
    }

    #[test]
    fn a_joint_state_has_the_bytes_of_ros() {
        assert_eq!(encode(&state()).expect("bytes"), BYTES.concat());
        assert_eq!(decode(&BYTES.concat()), Some(state()));
        let mut filled = BYTES.concat();
        filled[3] = 3;
        assert_eq!(decode(&filled), Some(state()), "the options name three bytes at the end");
    }

    #[test]
    fn cut_and_changed_messages_are_none_or_another_message() {
        let bytes = BYTES.concat();
        for end in 0..bytes.len() {
            assert_eq!(decode::<JointStateMessage>(&bytes[..end]), None, "{end} bytes");
        }
        for place in 0..bytes.len() {
            for value in [0, 1, 0x7F, 0xFF] {
                let mut changed = bytes.clone();
                changed[place] = value;
                let _ = decode::<JointStateMessage>(&changed);
            }
        }
    }
}
