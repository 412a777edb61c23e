//! Frames, written from `docs/protocol.md`, section 2, without code of the product.

use crc::{CRC_16_MODBUS, Crc};

const MODBUS: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_equal_the_documented_examples() {
        assert_eq!(read_request(54, 7), [0xaa, 0x77, 0x03, 0x36, 0x07, 0x81, 0xce]);
        assert_eq!(write_request(28, &[0]), [0xaa, 0x77, 0x06, 0x1c, 0x01, 0x00, 0x2c, 0xc4]);
        let positions = [90, 90, 65, 90, 90, 90, 80];
        let documented = [0xaa, 0x77, 0x03, 0x36, 0x07, 0x5a, 0x5a, 0x41, 0x5a, 0x5a, 0x5a, 0x50, 0x43, 0x81];
        assert_eq!(reply(54, &positions), documented);
    }
}
