//! The values of consecutive registers at one instant, from one read.

use protocol_core::registers::map::{EXTENDED_VERSION, PROTECTION_VERSION, STATUS_VERSION};
use protocol_core::registers::{Joint, Register};

use crate::span::Span;

/// The only known layout version of the extended block, the protection block and the status block.
const KNOWN_LAYOUT: u8 = 1;

/// The values of consecutive registers at one instant.
///
/// ```
/// use host_link::Snapshot;
/// use protocol_core::registers::map::{SPEED, TARGET_POSITION};
///
/// let snapshot = Snapshot { address: SPEED.address, values: (0..21).collect() };
/// assert_eq!(snapshot.joints(&TARGET_POSITION), [14, 15, 16, 17, 18, 19, 20]);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// The first register.
    pub address: u8,
    /// One value for each register.
    pub values: Vec<u8>,
}

impl Snapshot {
    /// The value of the register at `address`; 0 if the read did not include it. The arm also answers 0 where the table
    /// has no register.
    #[must_use]
    pub fn at(&self, address: u8) -> u8 {
        let offset = address.checked_sub(self.address).map(usize::from);
        offset.and_then(|offset| self.values.get(offset)).copied().unwrap_or(0)
    }

    /// The value of a row that has one register.
    #[must_use]
    pub fn byte(&self, row: &Register) -> u8 {
        self.at(row.address)
    }

    /// The value of a counter of two registers, low byte first.
    #[must_use]
    pub fn counter(&self, row: &Register) -> u16 {
        u16::from_le_bytes([self.at(row.address), self.at(row.address.wrapping_add(1))])
    }

    /// The values of a per-joint row, joint 1 first.
    #[must_use]
    pub fn joints(&self, row: &Register) -> [u8; 7] {
        Joint::ALL.map(|joint| self.at(row.of(joint)))
    }

    /// The raw two-byte value whose low byte is at `address`; bytes outside the snapshot are 0.
    #[must_use]
    pub fn word(&self, address: u8) -> u16 {
        u16::from_le_bytes([self.at(address), self.at(address.wrapping_add(1))])
    }

    /// The raw values of a per-joint row of two-byte registers, joint 1 first.
    #[must_use]
    pub fn words(&self, row: &Register) -> [u16; 7] {
        Joint::ALL.map(|joint| self.word(row.of(joint)))
    }

    /// Does the firmware have registers 128 to 191 in the known layout ([D21](protocol_core::decisions#d21))?
    #[must_use]
    pub fn has_extended_block(&self) -> bool {
        self.byte(&EXTENDED_VERSION) == KNOWN_LAYOUT
    }

    /// Does the firmware have registers 192 to 199 in the known layout ([D27](protocol_core::decisions#d27))?
    #[must_use]
    pub fn has_protection_block(&self) -> bool {
        self.byte(&PROTECTION_VERSION) == KNOWN_LAYOUT
    }

    /// Does the firmware have registers 240 to 255 in the known layout?
    #[must_use]
    pub fn has_status_block(&self) -> bool {
        self.byte(&STATUS_VERSION) == KNOWN_LAYOUT
    }

    /// Takes the values of another snapshot, as far as this one holds their registers. Takes none if the other one begins at a
    /// lower register.
    pub fn put(&mut self, other: &Self) {
        let first = usize::from(other.address).checked_sub(usize::from(self.address));
        let held = first.and_then(|first| self.values.get_mut(first..)).unwrap_or_default();
        held.iter_mut().zip(&other.values).for_each(|(held, value)| *held = *value);
    }

    /// The values of some registers; 0 where this snapshot does not hold them.
    #[must_use]
    pub fn part(&self, span: Span) -> Self {
        Self { address: span.address(), values: span.addresses().map(|address| self.at(address)).collect() }
    }

    /// Does it hold all of these registers?
    #[must_use]
    pub fn holds(&self, span: Span) -> bool {
        let end = usize::from(self.address) + self.values.len();
        self.address <= span.address() && usize::from(span.address()) + usize::from(span.count()) <= end
    }

    /// The registers; none if they would reach past 255 or exceed one frame.
    #[must_use]
    pub fn span(&self) -> Span {
        Span::of_values(self.address, &self.values).unwrap_or(Span::NONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::FRAMES_ACCEPTED;

    #[test]
    fn values_are_found_by_their_rows() {
        let snapshot = Snapshot { address: 245, values: vec![9, 0x34, 0x12] };
        assert_eq!(snapshot.counter(&FRAMES_ACCEPTED), 0x1234);
        assert_eq!(snapshot.at(245), 9);
        assert_eq!((snapshot.at(244), snapshot.at(248)), (0, 0), "beyond what was read");
        let holds = |address, count| Span::new(address, count).is_some_and(|span| snapshot.holds(span));
        assert_eq!([holds(245, 3), holds(246, 1), holds(244, 2), holds(247, 2)], [true, true, false, false]);
    }
}
