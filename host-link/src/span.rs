//! A range of registers that is checked when it is made: it never reaches past 255 ([D2](protocol_core::decisions#d2)).

use std::fmt;

use protocol_core::registers::Register;

const ADDRESSES: usize = 256;

/// Consecutive registers.
///
/// ```
/// use host_link::Span;
/// use protocol_core::registers::map;
///
/// assert_eq!(Span::of(&map::TARGET_POSITION).to_string(), "46..52");
/// assert_eq!(Span::new(250, 6).map(|span| span.to_string()).as_deref(), Some("250..255"));
/// assert_eq!(Span::new(250, 7), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    address: u8,
    count: u8,
}

impl Span {
    /// `count` registers from `address` on; `None` if they reach past 255.
    #[must_use]
    pub const fn new(address: u8, count: u8) -> Option<Self> {
        // The casts are lossless; `From` is not const.
        if address as usize + count as usize <= ADDRESSES { Some(Self { address, count }) } else { None }
    }

    /// No register.
    pub const NONE: Self = Self { address: 0, count: 0 };

    /// The register at `address`.
    #[must_use]
    pub const fn one(address: u8) -> Self {
        Self { address, count: 1 }
    }

    /// The registers for these values, one byte each; `None` if they reach past 255 or exceed one frame.
    #[must_use]
    pub fn of_values(address: u8, values: &[u8]) -> Option<Self> {
        Self::new(address, u8::try_from(values.len()).ok()?)
    }

    /// All registers of one row of the table.
    #[must_use]
    pub const fn of(row: &Register) -> Self {
        Self { address: row.address, count: row.count }
    }

    /// All registers from the first of one row of the table to the last of a later row.
    #[must_use]
    pub const fn between(first: &Register, last: &Register) -> Self {
        Self::of(first).through(last)
    }

    /// All registers from the first of this span to the last of a later row of the table.
    #[must_use]
    pub const fn through(self, last: &Register) -> Self {
        let distance = last.address.saturating_sub(self.address);
        Self { address: self.address, count: distance.saturating_add(last.count) }
    }

    /// The first register.
    #[must_use]
    pub const fn address(self) -> u8 {
        self.address
    }

    /// The number of registers, 0 to 255.
    #[must_use]
    pub const fn count(self) -> u8 {
        self.count
    }

    /// The addresses, in ascending order.
    pub fn addresses(self) -> impl Iterator<Item = u8> + Clone {
        (self.address..=u8::MAX).take(usize::from(self.count))
    }

    /// This span with `by` registers more: after it, or before it at the end of the map. `None` if neither is possible.
    pub(crate) fn widened(self, by: u8) -> Option<Self> {
        let count = self.count.checked_add(by)?;
        Self::new(self.address, count).or_else(|| Self::new(self.address.checked_sub(by)?, count))
    }
}

/// As in the documentation: `54..60`, with the last one included.
impl fmt::Display for Span {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.addresses().last() {
            Some(last) if last > self.address => write!(out, "{}..{last}", self.address),
            Some(only) => write!(out, "register {only}"),
            None => write!(out, "no register at {}", self.address),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::{FRAMES_ACCEPTED, MAP, OFFSET, STATUS_VERSION};

    #[test]
    fn a_span_is_shown_as_in_the_documentation() {
        assert_eq!(Span::of(&OFFSET).to_string(), "13..19");
        assert_eq!(Span::one(12).to_string(), "register 12");
        assert_eq!(Span::one(255).to_string(), "register 255");
        assert_eq!(Some(Span::between(&STATUS_VERSION, &FRAMES_ACCEPTED)), Span::new(240, 8));
    }

    #[test]
    fn no_span_reaches_past_the_last_register() {
        for row in MAP {
            assert!(Span::new(row.address, row.count).is_some(), "{}", row.name);
        }
        assert!(Span::new(255, 1).is_some() && Span::new(255, 2).is_none());
        assert!(Span::new(1, 255).is_some() && Span::new(2, 255).is_none());
        assert!(Span::of_values(250, &[0; 10]).is_none() && Span::of_values(0, &[0; 256]).is_none());
    }

    #[test]
    fn a_span_at_the_end_of_the_map_widens_to_the_front() {
        assert_eq!(Span::new(54, 7).and_then(|span| span.widened(1)), Span::new(54, 8));
        assert_eq!(Span::new(240, 16).and_then(|span| span.widened(2)), Span::new(238, 18));
        assert_eq!(Span::new(0, 255).and_then(|span| span.widened(1)), None);
    }
}
