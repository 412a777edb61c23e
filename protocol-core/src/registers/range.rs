//! The valid values of a register, and their encodings.

/// The valid values of a register. The raw value of a register is one byte, or two bytes with the low byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Every byte up to and including this one.
    UpTo(u8),
    /// Every byte from the first one to the second.
    Between(u8, u8),
    /// Bit 7 is the sign, the rest a magnitude up to and including this one; 0x80 is a zero
    /// ([D9](crate::decisions#d9)).
    SignMagnitude(u8),
    /// A number whose magnitude is at most this one, in any of three encodings: 128 more than the number, the number itself,
    /// or 256 more than a negative number ([M5](crate::decisions#m5)). The magnitude has to be at most 63: then the
    /// encodings do not overlap.
    Biased(u8),
    /// Two bytes: every number up to and including this one.
    WordUpTo(u16),
    /// Two bytes: 0, or a number from the first to the second.
    ZeroOr(u16, u16),
    /// Two bytes in two's complement.
    SignedWord,
}

/// The sign bit of [`Range::SignMagnitude`], and the zero of [`Range::Biased`].
pub(crate) const SIGN: u8 = 0x80;

impl Range {
    /// The bytes of one value: 1 or 2.
    #[must_use]
    pub const fn width(self) -> u8 {
        match self {
            Self::UpTo(_) | Self::Between(..) | Self::SignMagnitude(_) | Self::Biased(_) => 1,
            Self::WordUpTo(_) | Self::ZeroOr(..) | Self::SignedWord => 2,
        }
    }

    /// Is this raw value in the range?
    #[must_use]
    pub const fn contains(self, raw: u16) -> bool {
        let [byte, high] = raw.to_le_bytes();
        match self {
            Self::UpTo(max) => high == 0 && byte <= max,
            Self::Between(min, max) => high == 0 && min <= byte && byte <= max,
            Self::SignMagnitude(max) => high == 0 && byte & !SIGN <= max,
            Self::Biased(max) => high == 0 && byte.wrapping_add(max) & !SIGN <= 2 * max,
            Self::WordUpTo(max) => raw <= max,
            Self::ZeroOr(min, max) => raw == 0 || (min <= raw && raw <= max),
            Self::SignedWord => true,
        }
    }

    /// Decodes a raw value of this range: 0x85 is -5 in sign and magnitude.
    #[must_use]
    pub const fn decode(self, raw: u16) -> i32 {
        let [byte, _] = raw.to_le_bytes();
        // `as` widens here: `From` is not const.
        match self {
            Self::SignMagnitude(_) if byte & SIGN != 0 => -((byte & !SIGN) as i32),
            // All three encodings are the same modulo 128.
            Self::Biased(max) => (byte.wrapping_add(max) & !SIGN) as i32 - max as i32,
            Self::SignedWord => raw.cast_signed() as i32,
            _ => raw as i32,
        }
    }

    /// Encodes a number; `None` if it is outside the range.
    #[must_use]
    pub const fn encode(self, number: i32) -> Option<u16> {
        let [byte, high, 0, 0] = number.unsigned_abs().to_le_bytes() else { return None };
        let magnitude = u16::from_le_bytes([byte, high]);
        let raw = match self {
            Self::SignedWord if number < -0x8000 || number > 0x7FFF => return None,
            Self::SignedWord if number < 0 => magnitude.wrapping_neg(),
            Self::SignMagnitude(max) | Self::Biased(max) if magnitude > max as u16 => return None,
            Self::SignMagnitude(_) if number < 0 => magnitude | SIGN as u16,
            Self::Biased(_) if number < 0 => SIGN as u16 - magnitude,
            Self::Biased(_) => SIGN as u16 + magnitude,
            _ if number < 0 => return None,
            _ => magnitude,
        };
        if self.contains(raw) { Some(raw) } else { None }
    }

    /// Decodes the value of a one-byte register.
    #[must_use]
    pub fn decode_byte(self, byte: u8) -> i16 {
        i16::try_from(self.decode(byte.into())).unwrap_or(0)
    }

    /// Encodes a number for a register of one byte; `None` if it is outside the range.
    #[must_use]
    pub fn encode_byte(self, number: i16) -> Option<u8> {
        u8::try_from(self.encode(number.into())?).ok()
    }

    /// The smallest and the largest number of this range.
    #[must_use]
    pub const fn bounds(self) -> (i32, i32) {
        match self {
            Self::UpTo(max) => (0, max as i32),
            Self::Between(min, max) => (min as i32, max as i32),
            Self::SignMagnitude(max) | Self::Biased(max) => (-(max as i32), max as i32),
            Self::WordUpTo(max) | Self::ZeroOr(_, max) => (0, max as i32),
            Self::SignedWord => (-0x8000, 0x7FFF),
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
        for range in [
            Range::UpTo(0),
            Range::UpTo(100),
            Range::UpTo(255),
            Range::Between(20, 100),
            Range::SignMagnitude(16),
        ] {
            for byte in (0..=255).filter(|&byte| range.contains(byte) && byte != u16::from(SIGN)) {
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
        for number in -16..=16_i32 {
            let two = number.to_le_bytes()[0];
            let (two, biased) = (u16::from(two), u16::from(two.wrapping_add(128)));
            assert_eq!((range.contains(two), range.decode(two)), (true, number));
            assert_eq!((range.contains(biased), range.decode(biased)), (true, number));
            assert_eq!(range.encode(number), Some(biased));
        }
        let bytes = (0..=255).filter(|&byte| range.contains(byte)).count();
        assert_eq!(bytes, 2 * 33, "nothing else");
        assert_eq!((range.encode(17), range.encode(-17), range.bounds()), (None, None, (-16, 16)));
    }

    #[test]
    fn d22_words_survive_decode_and_encode() {
        for range in [Range::WordUpTo(18_000), Range::ZeroOr(5, 1_000), Range::SignedWord] {
            for raw in (0..=u16::MAX).filter(|&raw| range.contains(raw)) {
                assert_eq!(range.encode(range.decode(raw)), Some(raw), "{range:?}");
            }
            let (low, high) = range.bounds();
            assert_eq!((range.encode(low - 1), range.encode(high + 1), range.width()), (None, None, 2));
        }
        let period = Range::ZeroOr(5, 1_000);
        assert_eq!(
            [0, 1, 4, 5, 1_000, 1_001].map(|raw| period.contains(raw)),
            [true, false, false, true, true, false]
        );
        assert_eq!((Range::SignedWord.decode(0xFFFE), Range::SignedWord.encode(-2)), (-2, Some(0xFFFE)));
        assert_eq!(Range::WordUpTo(18_000).encode(65_536 + 5), None, "no silent truncation");
    }

    #[test]
    fn a_byte_register_takes_no_second_byte() {
        for range in [Range::UpTo(255), Range::Between(0, 255), Range::SignMagnitude(127), Range::Biased(16)]
        {
            assert!(range.contains(0) && !range.contains(0x100) && range.width() == 1, "{range:?}");
        }
    }
}
