//! The valid values of a register, and their encodings.

/// The valid values of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Every byte up to and including this one.
    UpTo(u8),
    /// Bit 7 is the sign, the rest a magnitude up to and including this one; 0x80 is a zero (D9).
    SignMagnitude(u8),
    /// A number from minus this one to this one, at most 56, in any of three encodings: 128 more than the number, the
    /// number itself, or 256 more than a negative number (M5). The three do not overlap.
    Biased(u8),
}

/// The sign bit of [`Range::SignMagnitude`], and the zero of [`Range::Biased`].
pub(crate) const SIGN: u8 = 0x80;

impl Range {
    /// Is `byte` in this range?
    #[must_use]
    pub const fn contains(self, byte: u8) -> bool {
        match self {
            Self::UpTo(max) => byte <= max,
            Self::SignMagnitude(max) => byte & !SIGN <= max,
            Self::Biased(max) => byte.wrapping_add(max) & !SIGN <= 2 * max,
        }
    }

    /// Decodes a byte of this range: 0x85 is -5 in sign and magnitude.
    #[must_use]
    pub const fn decode(self, byte: u8) -> i16 {
        // `as` widens here: `From` is not const.
        match self {
            Self::SignMagnitude(_) if byte & SIGN != 0 => -((byte & !SIGN) as i16),
            // All three encodings are the same modulo 128.
            Self::Biased(max) => (byte.wrapping_add(max) & !SIGN) as i16 - max as i16,
            _ => byte as i16,
        }
    }

    /// Encodes a number; `None` if it is outside the range.
    #[must_use]
    pub const fn encode(self, number: i16) -> Option<u8> {
        let magnitude = number.unsigned_abs();
        if magnitude > 0xFF {
            return None;
        }
        let byte = magnitude.to_le_bytes()[0];
        match self {
            Self::UpTo(max) if number >= 0 && byte <= max => Some(byte),
            Self::SignMagnitude(max) if byte <= max => Some(if number < 0 { byte | SIGN } else { byte }),
            Self::Biased(max) if byte <= max && number < 0 => Some(SIGN - byte),
            Self::Biased(max) if byte <= max => Some(SIGN + byte),
            _ => None,
        }
    }

    /// The smallest and the largest number of this range.
    #[must_use]
    pub const fn bounds(self) -> (i16, i16) {
        match self {
            Self::UpTo(max) => (0, max as i16),
            Self::SignMagnitude(max) | Self::Biased(max) => (-(max as i16), max as i16),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sign_and_magnitude_reads_and_writes_both_signs() {
        let range = Range::SignMagnitude(16);
        assert_eq!(range.decode(0x85), -5);
        assert_eq!(range.decode(0x80), 0, "minus zero is zero (D9)");
        assert_eq!(range.encode(-5), Some(0x85));
        assert_eq!(range.encode(0), Some(0));
        assert_eq!(range.encode(17), None);
        assert_eq!(range.encode(-17), None);
        assert_eq!(range.bounds(), (-16, 16));
    }

    #[test]
    fn every_value_of_a_range_survives_decode_and_encode() {
        for range in [Range::UpTo(0), Range::UpTo(100), Range::UpTo(255), Range::SignMagnitude(16)] {
            for byte in (0..=255).filter(|&byte| range.contains(byte) && byte != SIGN) {
                assert_eq!(range.encode(range.decode(byte)), Some(byte), "{range:?}");
            }
            let (low, high) = range.bounds();
            assert_eq!(range.encode(low - 1), None);
            assert_eq!(range.encode(high + 1), None);
        }
        assert_eq!(Range::UpTo(255).encode(256 + 5), None, "no silent truncation");
    }

    #[test]
    fn m05_an_offset_has_three_encodings() {
        let range = Range::Biased(16);
        for number in -16..=16_i16 {
            let two = number.to_le_bytes()[0];
            let biased = two.wrapping_add(128);
            assert_eq!((range.contains(two), range.decode(two)), (true, number));
            assert_eq!((range.contains(biased), range.decode(biased)), (true, number));
            assert_eq!(range.encode(number), Some(biased));
        }
        let bytes = (0..=255).filter(|&byte| range.contains(byte)).count();
        assert_eq!(bytes, 2 * 33, "nothing else");
        assert_eq!((range.encode(17), range.encode(-17), range.bounds()), (None, None, (-16, 16)));
    }
}
