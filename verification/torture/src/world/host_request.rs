//! Requests of the host and frames of the arm as bytes, and a search for unintended frames in the bytes that the host sent.
//!
//! Follows docs/protocol.md and shares no code with the parser under test.

use crc::{CRC_16_MODBUS, Crc};

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);
/// The bytes of the longest frame.
pub(super) const MAX_LENGTH: usize = 262;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum HostRequest {
    Read { address: u8, count: u8 },
    Write { address: u8, values: Vec<u8> },
    WriteMap21 { address: u8, values: Vec<u8> },
}

impl HostRequest {
    pub(super) fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Read { address, count } => frame(3, *address, *count, &[]),
            Self::Write { address, values } => frame(6, *address, count(values), values),
            Self::WriteMap21 { address, values } => frame(4, *address, count(values), values),
        }
    }

    /// True if the range ends at address 255 at most (D2).
    pub(super) fn is_well_formed(&self) -> bool {
        let (address, count) = match self {
            Self::Read { address, count } => (*address, usize::from(*count)),
            Self::Write { address, values } | Self::WriteMap21 { address, values } => {
                (*address, values.len())
            }
        };
        usize::from(address) + count <= 256
    }

    pub(super) const fn is_read(&self) -> bool {
        matches!(self, Self::Read { .. })
    }

    /// The length of the reply in bytes; 0 if there is no reply.
    pub(super) fn reply_length(&self) -> usize {
        match self {
            Self::Read { address, count } if usize::from(*address) + usize::from(*count) <= 256 => {
                7 + usize::from(*count)
            }
            _ => 0,
        }
    }

    /// The number of headers in the bytes of a malformed request that the arm may count as corrupted frames. The arm
    /// searches the bytes behind the header of a request that reaches past address 255 (D2, D3).
    pub(super) fn false_headers(&self) -> u16 {
        let bytes = self.bytes();
        let Some([address, count]) = bytes.get(3..5) else { return 0 };
        if u16::from(*address) + u16::from(*count) <= 256 {
            return 0;
        }
        let inside = bytes.windows(3).skip(1);
        let headers = inside.filter(|bytes| matches!(bytes, [0xAA, 0x77, 3 | 4 | 6]));
        u16::try_from(headers.count()).unwrap_or(u16::MAX)
    }
}

fn count(values: &[u8]) -> u8 {
    u8::try_from(values.len()).unwrap_or(u8::MAX)
}

fn frame(function: u8, address: u8, count: u8, values: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xAA, 0x77, function, address, count];
    bytes.extend(values);
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

/// A reply to a read. A report of map 2.2 has the same form.
pub(super) fn reply(address: u8, values: &[u8]) -> Vec<u8> {
    report(3, address, values)
}

/// A report, with the function code of its map.
pub(super) fn report(function: u8, address: u8, values: &[u8]) -> Vec<u8> {
    frame(function, address, count(values), values)
}

/// The alarm of an inverse kinematics without a solution (M8): `kind` is 5, 6 or 7.
pub(super) fn alarm(kind: u8) -> Vec<u8> {
    let mut bytes = vec![0xAA, 0x77, 8, 1, kind];
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

/// True if `bytes` begin with a frame that has a valid checksum.
fn is_frame(bytes: &[u8]) -> bool {
    let length = match bytes {
        [0xAA, 0x77, 3, ..] => 7,
        [0xAA, 0x77, 4 | 6, _, count, ..] => 7 + usize::from(*count),
        _ => return false,
    };
    let Some((covered, crc)) = bytes.get(..length).and_then(<[u8]>::split_last_chunk::<2>) else {
        return false;
    };
    CRC.checksum(covered).to_le_bytes() == *crc
}

/// The last bytes that were sent, and the offsets of intended frames. A new frame may begin in these bytes.
#[derive(Clone, Debug, Default)]
pub(super) struct SentStream {
    bytes: Vec<u8>,
    starts: Vec<usize>,
}

impl SentStream {
    /// Appends sent bytes. They begin with an intended frame if `is_intended`.
    pub(super) fn add(&mut self, bytes: &[u8], is_intended: bool) {
        if is_intended {
            self.starts.push(self.bytes.len());
        }
        self.bytes.extend(bytes);
    }

    /// True if the bytes contain a frame that the host did not intend, with a valid checksum by chance (one corrupted
    /// frame in 65 536) or because the corruption left it intact. The model could not follow an arm that received such a frame.
    pub(super) fn has_unintended_frame(&self) -> bool {
        let is_unintended =
            |start| !self.starts.contains(&start) && self.bytes.get(start..).is_some_and(is_frame);
        (0..self.bytes.len()).any(is_unintended)
    }

    /// Removes bytes in which no further frame can begin.
    pub(super) fn trim(&mut self) {
        let excess = self.bytes.len().saturating_sub(MAX_LENGTH);
        self.bytes.drain(..excess);
        self.starts.retain(|start| *start >= excess);
        self.starts.iter_mut().for_each(|start| *start -= excess);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_have_the_documented_bytes() {
        assert_eq!(HostRequest::Read { address: 54, count: 7 }.bytes(), [0xAA, 0x77, 3, 0x36, 7, 0x81, 0xCE]);
        let unlock = HostRequest::Write { address: 28, values: vec![0] };
        assert_eq!(unlock.bytes(), [0xAA, 0x77, 6, 0x1C, 1, 0, 0x2C, 0xC4]);
        let unlock = HostRequest::WriteMap21 { address: 28, values: vec![0] };
        assert_eq!(unlock.bytes(), [0xAA, 0x77, 4, 0x1C, 1, 0, 0x2D, 0x7C]);
        assert_eq!(alarm(6), [0xAA, 0x77, 8, 1, 6, 0x27, 0xFC]);
    }

    #[test]
    fn a_frame_inside_a_frame_is_unintended() {
        let inner = HostRequest::Read { address: 54, count: 7 }.bytes();
        let mut stream = SentStream::default();
        stream.add(&inner, true);
        assert!(!stream.has_unintended_frame());
        stream.add(&HostRequest::Write { address: 0, values: inner }.bytes(), true);
        assert!(stream.has_unintended_frame());
    }

    #[test]
    fn false_headers_count_in_malformed_requests_only() {
        let holding = |address| HostRequest::Write { address, values: vec![0xAA, 0x77, 3, 9, 0xAA, 0x77, 6] };
        assert_eq!(holding(46).false_headers(), 0);
        assert_eq!(holding(250).false_headers(), 2);
        assert_eq!(HostRequest::Write { address: 0xAA, values: vec![3; 0x77] }.false_headers(), 1);
        assert_eq!(HostRequest::Read { address: 250, count: 7 }.false_headers(), 0);
    }

    #[test]
    fn trim_keeps_a_bounded_number_of_bytes() {
        let mut stream = SentStream::default();
        for _ in 0..100 {
            stream.add(&HostRequest::Read { address: 1, count: 1 }.bytes(), true);
            stream.trim();
            assert!(!stream.has_unintended_frame());
        }
        assert!(stream.bytes.len() <= MAX_LENGTH && stream.starts.len() <= MAX_LENGTH / 7);
    }
}
