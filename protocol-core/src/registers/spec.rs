//! The types of the register table, and its checks at compile time.
//!
//! This file does not know any address. Both tables, map 2.2 and map 2.1, use these types.

use super::joint::{JOINTS, Joint};
use super::range::Range;
use super::unit::Unit;

/// The memory region of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Region {
    /// Constant for this chip and firmware.
    Rom,
    /// Survives power cuts; can be written only while the EEPROM lock is open.
    Eeprom,
    /// Has its default after every power-up, until the arm or a host sets it.
    Ram,
}

/// The access of a host to a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Can be read; a write has no effect.
    ReadOnly,
    /// Can be read and written, in EEPROM only while its lock is open.
    ReadWrite,
    /// Reserved by the maker, or not used: a write in this map has no effect. Reads 0, unless the other map writes the register.
    Reserved,
}

/// One row of the table: a register, or a run of registers that belong together (for example one per joint, or the
/// bytes of one longer value). The range tells whether a value has one byte or two, the low byte first
/// ([D22](crate::decisions#d22)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// The name of the constant: `TARGET_POSITION`.
    pub name: &'static str,
    /// The doc comment of the row, one string per line.
    pub doc: &'static [&'static str],
    /// Address of the first register of the run.
    pub address: u8,
    /// How many bytes the run holds, at least 1.
    pub count: u8,
    /// Is the run one value per joint?
    pub per_joint: bool,
    /// Where the value is kept, and for how long.
    pub region: Region,
    /// Whether a write by a host has an effect.
    pub access: Access,
    /// The valid values, which include the defaults, and the width of a value.
    pub range: Range,
    /// The raw values after power-up or, in EEPROM, of a new arm. A per-joint row has one for each joint.
    pub defaults: [u16; JOINTS],
    /// The unit of a raw value; [`Unit::None`] for a plain number, a code or bits.
    pub unit: Unit,
}

const fn row(region: Region, address: u8, access: Access) -> Register {
    Register {
        name: "",
        doc: &[],
        address,
        count: 1,
        per_joint: false,
        region,
        access,
        range: Range::UpTo(0xFF),
        defaults: [0; JOINTS],
        unit: Unit::None,
    }
}

/// A row in ROM, read only.
pub(crate) const fn rom(address: u8) -> Register {
    row(Region::Rom, address, Access::ReadOnly)
}

/// A row in EEPROM, readable and writable.
pub(crate) const fn eeprom(address: u8) -> Register {
    row(Region::Eeprom, address, Access::ReadWrite)
}

/// A row in RAM, readable and writable.
pub(crate) const fn ram(address: u8) -> Register {
    row(Region::Ram, address, Access::ReadWrite)
}

impl Register {
    /// Makes the row a run of one value per joint.
    pub(crate) const fn each_joint(mut self) -> Self {
        self.count = 7 * self.range.width();
        self.per_joint = true;
        self
    }

    /// Gives the row values of two bytes in this range. Call this before [`Register::each_joint`], which counts the bytes.
    pub(crate) const fn word(mut self, range: Range) -> Self {
        self.count = range.width();
        self.range = range;
        self
    }

    /// Makes the row a run of `count` registers.
    pub(crate) const fn run(mut self, count: u8) -> Self {
        self.count = count;
        self
    }

    pub(crate) const fn read_only(mut self) -> Self {
        self.access = Access::ReadOnly;
        self
    }

    pub(crate) const fn reserved(mut self) -> Self {
        self.access = Access::Reserved;
        self
    }

    /// Sets the range 0 to `max`.
    pub(crate) const fn up_to(mut self, max: u8) -> Self {
        self.range = Range::UpTo(max);
        self
    }

    /// Sets the range `min` to `max`.
    pub(crate) const fn between(mut self, min: u8, max: u8) -> Self {
        self.range = Range::Between(min, max);
        self
    }

    /// Sets the range -`max` to `max`, as sign and magnitude.
    pub(crate) const fn plus_minus(mut self, max: u8) -> Self {
        self.range = Range::SignMagnitude(max);
        self
    }

    /// Sets the range -`max` to `max`, in any of the three encodings of [`Range::Biased`].
    pub(crate) const fn biased(mut self, max: u8) -> Self {
        self.range = Range::Biased(max);
        self
    }

    pub(crate) const fn default(mut self, value: u16) -> Self {
        self.defaults = [value; JOINTS];
        self
    }

    /// Sets the default of each joint, joint 1 first.
    pub(crate) const fn default_each(mut self, values: [u16; JOINTS]) -> Self {
        self.defaults = values;
        self
    }

    pub(crate) const fn unit(mut self, unit: Unit) -> Self {
        self.unit = unit;
        self
    }

    /// Sets the name and the doc comment. The macros of the two tables call it.
    pub(crate) const fn described(mut self, name: &'static str, doc: &'static [&'static str]) -> Self {
        self.name = name;
        self.doc = doc;
        self
    }

    /// The address of a joint's value in a per-joint row, or of its low byte; the row's first address in any other.
    #[must_use]
    pub const fn of(&self, joint: Joint) -> u8 {
        let distance = joint.index() * self.range.width();
        if self.per_joint { self.address.wrapping_add(distance) } else { self.address }
    }

    /// Is `address` inside the run? Also true for the second byte of a value.
    #[must_use]
    pub const fn holds(&self, address: u8) -> bool {
        address.wrapping_sub(self.address) < self.count
    }

    /// The joint whose value holds `address`; `None` if the row is not per joint or does not hold `address`.
    #[must_use]
    pub const fn joint_at(&self, address: u8) -> Option<Joint> {
        let index = address.wrapping_sub(self.address) / self.range.width();
        if self.per_joint { Joint::from_index(index) } else { None }
    }

    /// The defaults of a per-joint row with values of one byte.
    #[must_use]
    pub fn default_bytes(&self) -> [u8; JOINTS] {
        Joint::ALL.map(|joint| self.default_at(self.of(joint)))
    }

    /// The default of the byte at `address`, which the run must hold.
    #[must_use]
    pub const fn default_at(&self, address: u8) -> u8 {
        let distance = address.wrapping_sub(self.address);
        let index = if self.per_joint { distance / self.range.width() } else { 0 };
        let (low, high) = match self.defaults.as_slice().split_at_checked(index as usize) {
            Some((_, [value, ..])) => {
                let [low, high] = value.to_le_bytes();
                (low, high)
            }
            _ => (0, 0),
        };
        if self.range.width() == 2 && distance % 2 == 1 { high } else { low }
    }
}

/// Checks a table at compile time: ascending addresses, ROM before EEPROM before RAM, no overlap, all addresses below
/// 256, only whole values in each row, seven values in each per-joint row, and every default within its range.
#[must_use]
pub const fn well_formed(map: &[Register]) -> bool {
    let mut rest = map;
    let mut next = 0;
    let mut region = Region::Rom;
    while let [row, tail @ ..] = rest {
        let end = row.address as usize + row.count as usize;
        let width = row.range.width();
        let joints_are_right = !row.per_joint || row.count == 7 * width;
        let shape_is_right = row.count > 0 && row.count % width == 0 && joints_are_right;
        let is_in_order = row.address as usize >= next && row.region as u8 >= region as u8;
        if !is_in_order || end > 256 || !shape_is_right {
            return false;
        }
        let mut defaults = row.defaults.as_slice();
        while let [value, others @ ..] = defaults {
            if !row.range.contains(*value) {
                return false;
            }
            defaults = others;
        }
        next = end;
        region = row.region;
        rest = tail;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_table_is_refused() {
        assert!(well_formed(&[ram(1), ram(2).run(3), ram(5)]));
        assert!(!well_formed(&[ram(2), ram(1)]), "order");
        assert!(well_formed(&[rom(1), eeprom(2), ram(3)]));
        assert!(!well_formed(&[ram(1), eeprom(2)]) && !well_formed(&[eeprom(1), rom(2)]), "regions");
        assert!(!well_formed(&[ram(1).run(2), ram(2)]), "overlap");
        assert!(!well_formed(&[ram(255).run(2)]), "past the end");
        assert!(!well_formed(&[ram(1).run(0)]), "empty");
        assert!(!well_formed(&[ram(1).up_to(3).default(4)]), "default out of range");
        assert!(!well_formed(&[ram(1).each_joint().run(6)]), "a joint is missing");
        let word = ram(1).word(Range::WordUpTo(300));
        assert!(well_formed(&[word, ram(3)]) && well_formed(&[word.each_joint(), ram(15)]));
        assert!(!well_formed(&[word.run(1)]) && !well_formed(&[word.run(3)]), "half a word");
        assert!(!well_formed(&[word.default(301)]), "default of a word out of range");
    }

    #[test]
    fn a_row_holds_its_addresses() {
        let row = ram(46).each_joint().default_each([1, 2, 3, 4, 5, 6, 7]);
        assert!(row.holds(46) && row.holds(52) && !row.holds(45) && !row.holds(53));
        assert_eq!(row.joint_at(48), Joint::new(3));
        assert_eq!(row.joint_at(53), None);
        assert_eq!(row.joint_at(45), None);
        assert_eq!((row.default_at(48), row.default_bytes()), (3, [1, 2, 3, 4, 5, 6, 7]));
        assert_eq!(ram(46).of(Joint::ALL[6]), 46, "a row without joints has one address");
    }

    #[test]
    fn d22_a_row_of_words_holds_both_bytes_of_each() {
        let row = ram(128).word(Range::WordUpTo(18_000)).each_joint().default_each([1, 9_000, 3, 4, 5, 6, 7]);
        assert_eq!((row.count, row.of(Joint::ALL[1]), row.of(Joint::ALL[6])), (14, 130, 140));
        assert_eq!([130, 131].map(|address| row.joint_at(address)), [Joint::new(2); 2]);
        assert_eq!([130, 131].map(|address| row.default_at(address)), [0x28, 0x23]);
        assert_eq!(row.joint_at(142), None);
        let period = ram(184).word(Range::ZeroOr(5, 1_000)).default(0x0102 * 2);
        assert_eq!([184, 185].map(|address| period.default_at(address)), [4, 2]);
    }

    #[test]
    fn a_row_has_the_properties_that_were_set() {
        let row = rom(2).run(6).described("CHIP_ID", &["Which chip."]);
        assert_eq!(
            (row.region, row.access, row.count, row.name),
            (Region::Rom, Access::ReadOnly, 6, "CHIP_ID")
        );
        let row = eeprom(13).each_joint().plus_minus(16).unit(Unit::Degree);
        assert_eq!((row.region, row.access, row.count), (Region::Eeprom, Access::ReadWrite, 7));
        assert_eq!((row.range, row.unit.symbol()), (Range::SignMagnitude(16), "°"));
        assert_eq!(eeprom(8).reserved().access, Access::Reserved);
        let row = ram(254).read_only().default(3);
        assert_eq!((row.region, row.access, row.default_at(254)), (Region::Ram, Access::ReadOnly, 3));
        assert_eq!(ram(46).each_joint().default(90).default_at(53), 0, "it does not hold this one");
    }
}
