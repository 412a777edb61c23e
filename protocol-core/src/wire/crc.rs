//! CRC-16/MODBUS (reflected polynomial 0x8005, start 0xFFFF, no final xor), four bytes at a step, no table.
//!
//! The polynomial is (x + 1)(x^15 + x + 1), and each factor is easy on its own:
//!
//! * modulo `x + 1` the remainder is the parity of all message bits: one exclusive-or a word;
//! * modulo `x^15 + x + 1`, x^16 is `x^2 + x`: a step shifts and adds, and nobody looks at a single bit.
//!
//! The second remainder has room for 16 bits where 15 are needed; at the end the parity says which of the
//! two numbers that it stands for is the CRC. The unit test holds this against the `crc` crate.

/// `x^15 + x + 1` in reflected notation: the lowest bit is x^15.
const FACTOR: u16 = 0xC001;

/// A running checksum.
#[derive(Clone, Copy, Debug)]
pub struct Crc {
    /// Remainder modulo `x^15 + x + 1`, in 16 bits.
    remainder: u32,
    /// Has the parity of all message bits so far. The start value is of even parity and adds nothing.
    parity: u32,
}

impl Default for Crc {
    fn default() -> Self {
        Self::new()
    }
}

impl Crc {
    /// The checksum of nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { remainder: 0xFFFF, parity: 0 }
    }

    /// The checksum with one more byte.
    #[must_use]
    pub const fn byte(self, byte: u8) -> Self {
        let word = self.remainder ^ byte as u32;
        let low = word & 0xFF;
        Self { remainder: word >> 8 ^ low << 6 ^ low << 7, parity: self.parity ^ byte as u32 }
    }

    /// The checksum with four more bytes, the first of them lowest.
    #[must_use]
    const fn word(self, data: u32) -> Self {
        // As a polynomial the word is `high * x^16 + low`, so its step is
        // `high * (x^2 + x)^2 + low * (x^2 + x)`: at most x^19, with x^19 in bit 0.
        let word = self.remainder ^ data;
        let high = word & 0xFFFF;
        let low = word >> 16;
        let sum = high ^ high << 2 ^ low << 2 ^ low << 3;
        // x^19 to x^16 wrap round as x^5 to x^2 and x^4 to x.
        let excess = sum & 0xF;
        let sum = sum ^ excess << 14 ^ excess << 15;
        Self { remainder: sum >> 4, parity: self.parity ^ data }
    }

    /// The checksum with these bytes after those before.
    #[must_use]
    pub fn bytes(self, bytes: &[u8]) -> Self {
        let (words, rest) = bytes.as_chunks();
        let crc = words.iter().fold(self, |crc, word| crc.word(u32::from_le_bytes(*word)));
        rest.iter().fold(crc, |crc, &byte| crc.byte(byte))
    }

    /// The checksum as it goes on the wire, low byte first.
    #[must_use]
    pub const fn finish(self) -> u16 {
        // Both fit: a remainder has 16 bits.
        let [low, high, ..] = self.remainder.to_le_bytes();
        let remainder = u16::from_le_bytes([low, high]);
        let wrong = (self.remainder ^ self.parity).count_ones() & 1 == 1;
        if wrong { remainder ^ FACTOR } else { remainder }
    }
}

/// The checksum of `bytes`.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u16 {
    Crc::new().bytes(bytes).finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const REFERENCE: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS);

    #[test]
    fn the_check_value_is_right() {
        assert_eq!(checksum(b"123456789"), 0x4B37);
        assert_eq!(checksum(b""), 0xFFFF);
    }

    #[test]
    fn every_message_of_up_to_two_bytes_agrees_with_the_crc_crate() {
        for a in 0..=255 {
            assert_eq!(checksum(&[a]), REFERENCE.checksum(&[a]));
            for b in 0..=255 {
                assert_eq!(checksum(&[a, b]), REFERENCE.checksum(&[a, b]));
            }
        }
    }

    #[test]
    fn every_single_bit_of_a_longest_frame_agrees_with_the_crc_crate() {
        // The CRC is affine: together with the zero message this fixes it for every message of the length.
        for length in [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 260] {
            let mut message = vec![0; length];
            assert_eq!(checksum(&message), REFERENCE.checksum(&message));
            for bit in 0..length * 8 {
                message[bit / 8] = 1 << (bit % 8);
                assert_eq!(checksum(&message), REFERENCE.checksum(&message), "bit {bit} of {length} bytes");
                message[bit / 8] = 0;
            }
        }
    }

    proptest! {
        #[test]
        fn any_message_in_any_pieces_agrees_with_the_crc_crate(
            message in proptest::collection::vec(any::<u8>(), 0..600),
            cut in 0_usize..600,
        ) {
            let (head, tail) = message.split_at(cut.min(message.len()));
            let crc = Crc::new().bytes(head).bytes(tail).finish();
            prop_assert_eq!(crc, REFERENCE.checksum(&message));
        }
    }
}
