//! Frames, written from `docs/protocol.md`, sections 2, 8 and 9, without code of the product.

use crc::{CRC_16_MODBUS, Crc};

use crate::registers::TARGET_POSITION;

const MODBUS: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);
/// First and last register of the fine targets.
const FINE_TARGETS: (u8, u8) = (128, 141);

/// The bytes, followed by their checksum, low byte first.
#[must_use]
pub fn with_checksum(bytes: &[u8]) -> Vec<u8> {
    let mut frame = bytes.to_vec();
    frame.extend(MODBUS.checksum(bytes).to_le_bytes());
    frame
}

/// A request to read `count` registers from `address` on.
#[must_use]
pub fn read_request(address: u8, count: u8) -> Vec<u8> {
    with_checksum(&[0xAA, 0x77, 0x03, address, count])
}

/// A request to write values to the registers from `address` on.
#[must_use]
pub fn write_request(address: u8, values: &[u8]) -> Vec<u8> {
    let count = u8::try_from(values.len()).expect("a frame holds 255 values");
    let mut frame = vec![0xAA, 0x77, 0x06, address, count];
    frame.extend(values);
    with_checksum(&frame)
}

/// The reply with the values of the registers from `address` on.
#[must_use]
pub fn reply(address: u8, values: &[u8]) -> Vec<u8> {
    let mut frame = write_request(address, values);
    frame.truncate(frame.len() - 2);
    frame[2] = 0x03;
    with_checksum(&frame)
}

/// Does the frame write a target of map 2.2?
#[must_use]
pub fn is_target(frame: &[u8]) -> bool {
    let &[_, _, 0x06, address, count, ..] = frame else { return false };
    let Some(last) = count.checked_sub(1).map(|more| address.saturating_add(more)) else { return false };
    let holds = |(from, to): (u8, u8)| address <= to && last >= from;
    holds((TARGET_POSITION, TARGET_POSITION + 6)) || holds(FINE_TARGETS)
}

/// Cuts bytes into frames. Bytes outside frames are passed on as they are.
#[derive(Debug)]
pub struct FrameSplitter {
    bytes: Vec<u8>,
    is_of_arm: bool,
    count: u32,
}

impl FrameSplitter {
    /// For the bytes of an arm if `is_of_arm`, otherwise for those of a program.
    #[must_use]
    pub const fn new(is_of_arm: bool) -> Self {
        Self { bytes: Vec::new(), is_of_arm, count: 0 }
    }

    /// Adds bytes in the order in which they came.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// The number of frames that [`Self::next`] has returned, without bytes outside frames.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// The next frame, or bytes outside of one. `None` if there is no whole frame.
    #[expect(clippy::should_implement_trait, reason = "more bytes may come after a `None`")]
    pub fn next(&mut self) -> Option<Vec<u8>> {
        let length = match self.bytes.as_slice() {
            [0xAA, 0x77, function, _, count, ..] => {
                self.count += u32::from(self.bytes.len() >= self.length(*function, *count));
                self.length(*function, *count)
            }
            [] | [0xAA] | [0xAA, 0x77, ..] => return None,
            [0xAA, ..] => 1,
            other => other.iter().position(|&byte| byte == 0xAA).unwrap_or(other.len()),
        };
        (self.bytes.len() >= length).then(|| self.bytes.drain(..length).collect())
    }

    /// The length of a frame, with its checksum.
    fn length(&self, function: u8, count: u8) -> usize {
        let has_values = match function {
            0x03 | 0x05 => self.is_of_arm,
            // An alarm has no count.
            0x08 => false,
            _ => true,
        };
        7 + if has_values { usize::from(count) } else { 0 }
    }
}
