//! CRC-16/MODBUS (reflected polynomial 0x8005, start 0xFFFF, no final xor), four bytes per step, without a table.
//!
//! The polynomial is (x + 1)(x^15 + x + 1). Each factor is cheap to reduce by:
//!
//! * Modulo `x + 1` the remainder is the parity of all message bits: one exclusive-or per word.
//! * Modulo `x^15 + x + 1`, x^32 is `x^4 + x^2`: reducing a word takes two shifts and no loop over bits.
//!
//! The remainder modulo `x^15 + x + 1` leaves two candidates for the CRC. Parity selects the CRC from the two.
//! The unit tests compare the result with the `crc` crate.

/// `x^15 + x + 1` in reflected notation of 16 bits: bit 0 is x^15.
const FACTOR: u32 = 0xC001;

/// The CRC of `bytes`. On the wire its low byte comes first.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u16 {
    Crc::START.bytes(bytes).finish()
}

/// A CRC in progress.
#[derive(Clone, Copy)]
pub(super) struct Crc {
    /// The message so far modulo `x^15 + x + 1`, in reflected notation: bit 0 is x^31.
    sum: u32,
    /// A word with the parity of all message bits so far.
    parity: u32,
}

impl Crc {
    /// The state before the first byte: times x^16 it is the start value 0xFFFF, which has even parity.
    pub(super) const START: Self = Self { sum: 0xD556_0000, parity: 0 };

    #[inline(never)]
    pub(super) fn bytes(self, bytes: &[u8]) -> Self {
        // Two words per iteration halve the cost of the loop itself.
        let (pairs, rest) = bytes.as_chunks();
        let crc = pairs
            .iter()
            .fold(self, |crc, &[a, b, c, d, e, f, g, h]| crc.word([a, b, c, d]).word([e, f, g, h]));
        let (words, rest) = rest.as_chunks();
        let crc = words.iter().fold(crc, |crc, word| crc.word(*word));
        let (halves, rest) = rest.as_chunks();
        let crc = halves.iter().fold(crc, |crc, half| crc.half(*half));
        rest.iter().fold(crc, |crc, &byte| crc.byte(byte))
    }

    pub(super) const fn word(self, bytes: [u8; 4]) -> Self {
        self.step(u32::from_le_bytes(bytes), 32)
    }

    pub(super) const fn half(self, bytes: [u8; 2]) -> Self {
        self.step(u16::from_le_bytes(bytes) as u32, 16)
    }

    pub(super) const fn byte(self, byte: u8) -> Self {
        self.step(byte as u32, 8)
    }

    /// Appends the lowest `bits` bits of `data`.
    #[inline(always)]
    const fn step(self, data: u32, bits: u32) -> Self {
        // Two shifts reduce the bits above x^31. The few bits that the shifts move above x^31 again are reduced once more.
        let leaving = self.sum << (32 - bits);
        let leaving = leaving ^ leaving << 30 ^ leaving << 28;
        let staying = if bits < 32 { self.sum >> bits } else { 0 };
        Self { sum: staying ^ data << (32 - bits) ^ leaving >> 2 ^ leaving >> 4, parity: self.parity ^ data }
    }

    /// The CRC of all bytes appended.
    pub(super) const fn finish(self) -> u16 {
        // Multiplied by x^16 = x^2 + x, `high * x^16 + low` reaches x^19, which is bit 0 here.
        let high = self.sum & 0xFFFF;
        let low = self.sum >> 16;
        let sum = high ^ high << 2 ^ low << 2 ^ low << 3;
        let excess = sum & 0xF;
        let remainder = sum >> 4 ^ excess << 10 ^ excess << 11;
        let is_odd = (remainder ^ self.parity).count_ones() & 1 == 1;
        let [low, high, ..] = (if is_odd { remainder ^ FACTOR } else { remainder }).to_le_bytes();
        u16::from_le_bytes([low, high])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const REFERENCE: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS);

    #[test]
    fn the_check_value_is_correct() {
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
        // The CRC is affine, so these messages and the zero message prove the agreement for every message of the length.
        for length in [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 260] {
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
        fn any_message_agrees_with_the_crc_crate(message in proptest::collection::vec(any::<u8>(), 0..600)) {
            prop_assert_eq!(checksum(&message), REFERENCE.checksum(&message));
        }
    }
}
