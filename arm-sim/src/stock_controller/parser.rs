//! The maker's parser: one frame at a time, no timeout, and no search for a header in the bytes of a damaged frame.

use alloc::vec::Vec;

use protocol_core::wire::crc::checksum;

const HEADER: [u8; 2] = [0xAA, 0x77];
const READ: u8 = 3;
const WRITE: u8 = 4;

/// A well-formed frame from the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum StockRequest {
    /// Function 03.
    Read { address: u8, count: u8 },
    /// Function 04.
    Write { address: u8, values: Vec<u8> },
}

/// The bytes of the frame so far, header included.
#[derive(Clone, Debug, Default)]
pub(super) struct Parser {
    frame: Vec<u8>,
}

impl Parser {
    /// Takes a byte. Returns the request that it completes.
    pub(super) fn push(&mut self, byte: u8) -> Option<StockRequest> {
        self.frame.push(byte);
        let is_complete = match self.frame.as_slice() {
            [first] => return self.drop_unless(*first == HEADER[0]),
            [_, second] => return self.drop_unless(*second == HEADER[1]),
            [_, _, 0] => {
                // A function 00 is skipped.
                self.frame.pop();
                return None;
            }
            [_, _, function] => return self.drop_unless(matches!(*function, READ | WRITE)),
            [_, _, READ, _, _, _, _] => true,
            [_, _, WRITE, _, count, ..] => self.frame.len() == 7 + usize::from(*count),
            _ => false,
        };
        if !is_complete {
            return None;
        }
        let frame = core::mem::take(&mut self.frame);
        let (body, sum) = frame.split_last_chunk::<2>()?;
        (checksum(body).to_le_bytes() == *sum).then(|| request(body)).flatten()
    }

    fn drop_unless(&mut self, is_expected: bool) -> Option<StockRequest> {
        if !is_expected {
            self.frame.clear();
        }
        None
    }
}

fn request(body: &[u8]) -> Option<StockRequest> {
    match body {
        [_, _, READ, address, count] => Some(StockRequest::Read { address: *address, count: *count }),
        [_, _, WRITE, address, _, values @ ..] => {
            Some(StockRequest::Write { address: *address, values: values.to_vec() })
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn requests(bytes: &[u8]) -> Vec<StockRequest> {
        let mut parser = Parser::default();
        bytes.iter().filter_map(|&byte| parser.push(byte)).collect()
    }

    const READ_ANGLES: [u8; 7] = [0xAA, 0x77, 3, 0x53, 7, 0xAA, 0x9E];
    const ID_5: [u8; 8] = [0xAA, 0x77, 4, 0x0B, 1, 5, 0x5D, 0x7B];

    #[test]
    fn the_frames_of_map_2_1_are_parsed() {
        assert_eq!(requests(&READ_ANGLES), [StockRequest::Read { address: 83, count: 7 }]);
        assert_eq!(requests(&ID_5), [StockRequest::Write { address: 11, values: alloc::vec![5] }]);
    }

    #[test]
    fn a_frame_of_map_2_2_is_dropped_at_its_function() {
        let bytes = [&[0xAA, 0x77, 6, 0x1C, 1, 0, 0x2C, 0xC4][..], &ID_5].concat();
        assert_eq!(requests(&bytes).len(), 1);
    }

    #[test]
    fn a_lost_byte_costs_the_next_frame_too() {
        let bytes = [&ID_5[..7], &ID_5, &ID_5].concat();
        assert_eq!(requests(&bytes).len(), 1);
    }

    #[test]
    fn a_wrong_checksum_is_silently_dropped() {
        let mut damaged = ID_5;
        damaged[5] ^= 1;
        assert_eq!(requests(&[damaged, ID_5].concat()).len(), 1);
    }
}
