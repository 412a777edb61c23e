//! Registers as they were at one instant: what a single read brought.
//!
//! Knows which registers it holds, not what they mean.

use std::fmt;

use protocol_core::registers::{Joint, Register};

/// A run of registers: `count` of them from `address` on.
///
/// ```
/// use sevenbot::{Span, map};
///
/// assert_eq!(Span::of(&map::TARGET_POSITION).to_string(), "46..52");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The first register.
    pub address: u8,
    /// How many.
    pub count: u8,
}

impl Span {
    /// All registers of one row of the table.
    #[must_use]
    pub const fn of(row: &Register) -> Self {
        Self { address: row.address, count: row.count }
    }

    /// Everything from one row of the table to another one behind it.
    #[must_use]
    pub const fn between(first: &Register, last: &Register) -> Self {
        let distance = last.address.saturating_sub(first.address);
        Self { address: first.address, count: distance.saturating_add(last.count) }
    }

    /// The addresses, in ascending order.
    pub fn addresses(self) -> impl Iterator<Item = u8> {
        (self.address..=u8::MAX).take(usize::from(self.count))
    }
}

/// As the documentation writes it: `54..60`, the last one included.
impl fmt::Display for Span {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.addresses().last() {
            Some(last) if last > self.address => write!(out, "{}..{last}", self.address),
            Some(only) => write!(out, "register {only}"),
            None => write!(out, "no register at {}", self.address),
        }
    }
}

/// The values one read brought, all of one instant.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sevenbot::{Arm, Span, map};
///
/// let mut arm = Arm::open("/dev/ttyUSB0", 115_200)?;
/// let snapshot = arm.read_span(Span::between(&map::SPEED, &map::TARGET_POSITION))?;
/// println!("{:?} {:?}", snapshot.joints(&map::SPEED), snapshot.joints(&map::TARGET_POSITION));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// The first register.
    pub address: u8,
    /// The values from there on.
    pub values: Vec<u8>,
}

impl Snapshot {
    /// The value of the register at `address`; 0 where the read did not reach, as the arm answers where
    /// its table is silent.
    #[must_use]
    pub fn at(&self, address: u8) -> u8 {
        let offset = address.checked_sub(self.address).map(usize::from);
        offset.and_then(|offset| self.values.get(offset)).copied().unwrap_or(0)
    }

    /// The value of a row with one register.
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

    /// The registers it holds.
    #[must_use]
    pub fn span(&self) -> Span {
        Span { address: self.address, count: u8::try_from(self.values.len()).unwrap_or(u8::MAX) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::{FRAMES_ACCEPTED, OFFSET, STATUS_VERSION};

    #[test]
    fn a_span_reads_as_the_documentation_writes_it() {
        assert_eq!(Span::of(&OFFSET).to_string(), "13..19");
        assert_eq!(Span { address: 12, count: 1 }.to_string(), "register 12");
        assert_eq!(Span { address: 255, count: 1 }.to_string(), "register 255");
        assert_eq!(Span::between(&STATUS_VERSION, &FRAMES_ACCEPTED), Span { address: 240, count: 8 });
    }

    #[test]
    fn values_are_found_by_their_rows() {
        let snapshot = Snapshot { address: 245, values: vec![9, 0x34, 0x12] };
        assert_eq!(snapshot.counter(&FRAMES_ACCEPTED), 0x1234);
        assert_eq!(snapshot.at(245), 9);
        assert_eq!((snapshot.at(244), snapshot.at(248)), (0, 0), "beyond what was read");
    }
}
