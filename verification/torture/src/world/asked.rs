//! What the host asks, as bytes and as meaning; and what else in a stream of bytes would count as a frame.
//!
//! Written from docs/protocol.md, not with the code under test.

use crc::{CRC_16_MODBUS, Crc};

const CHECK: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);
/// The longest frame.
pub(super) const LONGEST: usize = 262;

/// A request of the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Asked {
    Read { address: u8, count: u8 },
    Write { address: u8, values: Vec<u8> },
}

impl Asked {
    pub(super) fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Read { address, count } => frame(3, *address, *count, &[]),
            Self::Write { address, values } => frame(6, *address, count(values), values),
        }
    }
}

impl Asked {
    /// How many bytes its answer has; 0: there is none.
    pub(super) fn answer_length(&self) -> usize {
        match self {
            Self::Read { address, count } if usize::from(*address) + usize::from(*count) <= 256 => {
                7 + usize::from(*count)
            }
            _ => 0,
        }
    }

    /// How many times a frame with a wrong checksum seems to begin inside this request, where that counts: a
    /// request that reaches past address 255 is not well formed, so the bytes behind its header are searched
    /// (D2, D3). Whole frames are not among them: see [`Stream::has_phantom`].
    pub(super) fn false_headers(&self) -> u16 {
        let bytes = self.bytes();
        let Some([address, count]) = bytes.get(3..5) else { return 0 };
        if u16::from(*address) + u16::from(*count) <= 256 {
            return 0;
        }
        let inside = bytes.windows(3).skip(1);
        let headers = inside.filter(|bytes| matches!(bytes, [0xAA, 0x77, 3 | 6]));
        u16::try_from(headers.count()).unwrap_or(u16::MAX)
    }
}

fn count(values: &[u8]) -> u8 {
    u8::try_from(values.len()).unwrap_or(u8::MAX)
}

fn frame(function: u8, address: u8, count: u8, values: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xAA, 0x77, function, address, count];
    bytes.extend(values);
    bytes.extend(CHECK.checksum(&bytes).to_le_bytes());
    bytes
}

/// The answer to a read, and the shape of a report.
pub(super) fn answer(address: u8, values: &[u8]) -> Vec<u8> {
    frame(3, address, count(values), values)
}

/// Does a frame with a right checksum begin here?
pub(super) fn is_frame(bytes: &[u8]) -> bool {
    let length = match bytes {
        [0xAA, 0x77, 3, ..] => 7,
        [0xAA, 0x77, 6, _, count, ..] => 7 + usize::from(*count),
        _ => return false,
    };
    let Some((covered, crc)) = bytes.get(..length).and_then(<[u8]>::split_last_chunk::<2>) else {
        return false;
    };
    CHECK.checksum(covered).to_le_bytes() == *crc
}

/// The bytes that the arm may still make something of, and where in them a frame was meant to begin.
#[derive(Clone, Debug, Default)]
pub(super) struct Stream {
    bytes: Vec<u8>,
    starts: Vec<usize>,
}

impl Stream {
    /// Adds what is sent next; a frame that is meant begins with it.
    pub(super) fn add(&mut self, bytes: &[u8], is_meant: bool) {
        if is_meant {
            self.starts.push(self.bytes.len());
        }
        self.bytes.extend(bytes);
    }

    /// Is there a frame that nobody meant, by chance (one damaged frame in 65 536), or one that damage left
    /// whole? What such a stream asks for is not what the host wanted, so that it tells nothing of the arm.
    pub(super) fn has_phantom(&self) -> bool {
        let places =
            self.bytes.windows(3).enumerate().filter(|(_, window)| window.starts_with(&[0xAA, 0x77]));
        places
            .into_iter()
            .any(|(place, _)| !self.starts.contains(&place) && self.bytes.get(place..).is_some_and(is_frame))
    }

    /// Forgets what no frame to come can begin in.
    pub(super) fn trim(&mut self) {
        let excess = self.bytes.len().saturating_sub(LONGEST);
        self.bytes.drain(..excess);
        self.starts.retain(|start| *start >= excess);
        self.starts.iter_mut().for_each(|start| *start -= excess);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_those_of_the_documentation() {
        assert_eq!(Asked::Read { address: 54, count: 7 }.bytes(), [0xAA, 0x77, 3, 0x36, 7, 0x81, 0xCE]);
        let unlock = Asked::Write { address: 28, values: vec![0] };
        assert_eq!(unlock.bytes(), [0xAA, 0x77, 6, 0x1C, 1, 0, 0x2C, 0xC4]);
    }

    #[test]
    fn a_frame_inside_a_frame_is_a_phantom() {
        let inner = Asked::Read { address: 54, count: 7 }.bytes();
        let mut stream = Stream::default();
        stream.add(&inner, true);
        assert!(!stream.has_phantom());
        stream.add(&Asked::Write { address: 0, values: inner }.bytes(), true);
        assert!(stream.has_phantom());
    }

    #[test]
    fn false_headers_count_in_malformed_requests_only() {
        let holding = |address| Asked::Write { address, values: vec![0xAA, 0x77, 3, 9, 0xAA, 0x77, 6] };
        assert_eq!(holding(46).false_headers(), 0);
        assert_eq!(holding(250).false_headers(), 2);
        assert_eq!(Asked::Write { address: 0xAA, values: vec![3; 0x77] }.false_headers(), 1);
        assert_eq!(Asked::Read { address: 250, count: 7 }.false_headers(), 0);
    }

    #[test]
    fn what_is_too_old_is_forgotten() {
        let mut stream = Stream::default();
        for _ in 0..100 {
            stream.add(&Asked::Read { address: 1, count: 1 }.bytes(), true);
            stream.trim();
            assert!(!stream.has_phantom());
        }
        assert!(stream.bytes.len() <= LONGEST && stream.starts.len() <= LONGEST / 7);
    }
}
