//! A checked write, and its effect on each register.

use super::map::OFFSET;
use super::map21::{self, Map};
use super::rules::{EXTENDED_START, rule, rule_21};

/// A write that was checked and may be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Accepted<'a> {
    pub(super) map: Map,
    /// The first address of the write that can have an effect. Writes have no effect on the ROM below the EEPROM region,
    /// and none on the EEPROM region while it is locked.
    pub(super) start: u8,
    pub(super) values: &'a [u8],
}

impl Accepted<'_> {
    /// The map that the write is in.
    #[must_use]
    pub const fn map(&self) -> Map {
        self.map
    }

    /// The new value of the register at `address`; an offset is in sign and magnitude. `None` if the write does not
    /// include the register or has no effect on it ([D15](crate::decisions#d15)).
    #[must_use]
    pub fn value_at(&self, address: u8) -> Option<u8> {
        let value = *self.values.get(usize::from(address.checked_sub(self.start)?))?;
        match self.map {
            Map::V22 => rule(address).is_open().then_some(value),
            Map::V21 => rule_21(address).is_open().then(|| from_map21(address, value)),
        }
    }

    /// The new value of the two-byte register at `address`; `None` if the write does not include the register or has no
    /// effect on it.
    #[must_use]
    pub fn word_at(&self, address: u8) -> Option<u16> {
        let low = self.value_at(address)?;
        // Both bytes of a register have the same rule.
        let high = *self.values.get(usize::from(address.checked_sub(self.start)?) + 1)?;
        Some(u16::from_le_bytes([low, high]))
    }

    /// Does the write reach the extended block or an address above it? In map 2.2, only there do values have two bytes or a
    /// minimum.
    #[must_use]
    pub fn is_extended(&self) -> bool {
        usize::from(self.start) + self.values.len() > usize::from(EXTENDED_START)
    }

    /// The bytes for `N` registers from `address` on; `None` unless the write has an effect on all of them.
    #[must_use]
    pub fn values_at<const N: usize>(&self, address: u8) -> Option<[u8; N]> {
        let mut values = [0; N];
        for (value, address) in values.iter_mut().zip(address..=u8::MAX) {
            *value = self.value_at(address)?;
        }
        Some(values)
    }
}

/// Converts a byte of a write in map 2.1 to the stored value: an offset becomes sign and magnitude, other bytes stay.
pub(super) fn from_map21(address: u8, byte: u8) -> u8 {
    if map21::OFFSET.holds(address) {
        OFFSET.range.encode_byte(map21::OFFSET.range.decode_byte(byte)).unwrap_or(0)
    } else {
        byte
    }
}
