//! The words the register table is written in, and the checks it has to pass before it compiles.
//!
//! Knows no address. A later revision of the arm is a second table in the same words.

/// Number of joints, and of servos on the bus.
pub const JOINTS: usize = 7;

/// One of the seven joints. Users count from 1 (the base) to 7 (the claw); arrays count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Joint(u8);

impl Joint {
    /// All joints, 1 to 7.
    pub const ALL: [Self; JOINTS] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5), Self(6)];

    /// The joint with the user's number 1 to 7; `None` for any other.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        if number >= 1 && number <= 7 { Some(Self(number - 1)) } else { None }
    }

    /// The joint at position 0 to 6 of an array; `None` for any other.
    #[must_use]
    pub const fn from_index(index: u8) -> Option<Self> {
        if index < 7 { Some(Self(index)) } else { None }
    }

    /// The user's number, 1 to 7.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0 + 1
    }

    /// Position in arrays and in register blocks, 0 to 6.
    #[must_use]
    pub const fn index(self) -> u8 {
        self.0
    }

    /// This joint's bit in the joint sets of the status block: bit n-1 is joint n.
    #[must_use]
    pub const fn bit(self) -> u8 {
        1 << self.0
    }
}

/// Where a register's value lives, and so what it survives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Region {
    /// Fixed for this chip and firmware.
    Rom,
    /// Kept over power cuts; written only while the EEPROM lock is open.
    Eeprom,
    /// Starts from its default at every power-up.
    Ram,
}

/// What a host may do with a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Answers reads; a write has no effect.
    ReadOnly,
    /// Answers reads and takes writes.
    ReadWrite,
    /// Kept free by the maker: reads 0; a write has no effect.
    Reserved,
}

/// The unit of a register's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A plain number, a code, or bits.
    None,
    /// Degrees of a joint.
    Degree,
    /// 1.9 degrees per second (docs/protocol.md, D10).
    SpeedStep,
    /// Tenths of a second.
    Decisecond,
    /// Times a second.
    Hertz,
    /// Tenths of a volt.
    Decivolt,
    /// Degrees Celsius.
    Celsius,
    /// Tenths of a firmware version: 30 is 3.0.
    VersionTenths,
}

impl Unit {
    /// How the unit is written behind a number; empty for [`Unit::None`].
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Degree => "°",
            Self::SpeedStep => "× 1.9 °/s",
            Self::Decisecond => "× 100 ms",
            Self::Hertz => "Hz",
            Self::Decivolt => "× 0.1 V",
            Self::Celsius => "°C",
            Self::VersionTenths => "× 0.1",
        }
    }
}

/// The values a register takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Every byte up to and including this one.
    UpTo(u8),
    /// Bit 7 is the sign, the rest a magnitude up to and including this one; 0x80 is a zero (D9).
    SignMagnitude(u8),
}

/// The sign bit of [`Range::SignMagnitude`].
const SIGN: u8 = 0x80;

impl Range {
    /// Is `byte` a value of this range?
    #[must_use]
    pub const fn contains(self, byte: u8) -> bool {
        match self {
            Self::UpTo(max) => byte <= max,
            Self::SignMagnitude(max) => byte & !SIGN <= max,
        }
    }

    /// The number a byte stands for: 0x85 of a signed range is -5.
    #[must_use]
    pub const fn decode(self, byte: u8) -> i16 {
        // `as` widens here: `From` is not const.
        match self {
            Self::SignMagnitude(_) if byte & SIGN != 0 => -((byte & !SIGN) as i16),
            _ => byte as i16,
        }
    }

    /// The byte that stands for a number; `None` where the range does not hold it.
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
            _ => None,
        }
    }

    /// The smallest and the largest number of this range.
    #[must_use]
    pub const fn bounds(self) -> (i16, i16) {
        match self {
            Self::UpTo(max) => (0, max as i16),
            Self::SignMagnitude(max) => (-(max as i16), max as i16),
        }
    }
}

/// One row of the table: a register, or a run of registers that mean the same (one per joint, or the
/// bytes of one longer value).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// The row's name, in the spelling of the code: `TARGET_POSITION`.
    pub name: &'static str,
    /// What it is for: the row's doc comment, one line a string.
    pub doc: &'static [&'static str],
    /// Address of the first register of the run.
    pub address: u8,
    /// How many registers the run holds, at least 1.
    pub count: u8,
    /// Is the run one register per joint?
    pub per_joint: bool,
    /// Where the value lives.
    pub region: Region,
    /// What a host may do with it.
    pub access: Access,
    /// What it takes.
    pub range: Range,
    /// The value at power-up, or, in EEPROM, of a new arm; one a joint in a per-joint row.
    pub defaults: [u8; JOINTS],
    /// The unit of its value.
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
    /// One register per joint.
    pub(crate) const fn each_joint(mut self) -> Self {
        self.count = 7;
        self.per_joint = true;
        self
    }

    /// A run of `count` registers.
    pub(crate) const fn run(mut self, count: u8) -> Self {
        self.count = count;
        self
    }

    /// A host can read it only.
    pub(crate) const fn read_only(mut self) -> Self {
        self.access = Access::ReadOnly;
        self
    }

    /// Kept free by the maker.
    pub(crate) const fn reserved(mut self) -> Self {
        self.access = Access::Reserved;
        self
    }

    /// Takes 0 to `max`.
    pub(crate) const fn up_to(mut self, max: u8) -> Self {
        self.range = Range::UpTo(max);
        self
    }

    /// Takes -`max` to `max`, as sign and magnitude.
    pub(crate) const fn plus_minus(mut self, max: u8) -> Self {
        self.range = Range::SignMagnitude(max);
        self
    }

    /// Starts as `value`.
    pub(crate) const fn default(mut self, value: u8) -> Self {
        self.defaults = [value; JOINTS];
        self
    }

    /// Starts as these values, joint 1 first.
    pub(crate) const fn default_each(mut self, values: [u8; JOINTS]) -> Self {
        self.defaults = values;
        self
    }

    /// Counts in `unit`.
    pub(crate) const fn unit(mut self, unit: Unit) -> Self {
        self.unit = unit;
        self
    }

    /// The row's own name and doc comment; the table's macro fills them in.
    pub(crate) const fn described(mut self, name: &'static str, doc: &'static [&'static str]) -> Self {
        self.name = name;
        self.doc = doc;
        self
    }

    /// The address of a joint's register in a per-joint row; the row's first address in any other.
    #[must_use]
    pub const fn of(&self, joint: Joint) -> u8 {
        if self.per_joint { self.address.wrapping_add(joint.0) } else { self.address }
    }

    /// Does the run hold `address`?
    #[must_use]
    pub const fn holds(&self, address: u8) -> bool {
        address.wrapping_sub(self.address) < self.count
    }

    /// The joint whose register `address` is, in a per-joint row.
    #[must_use]
    pub const fn joint_at(&self, address: u8) -> Option<Joint> {
        if self.per_joint { Joint::from_index(address.wrapping_sub(self.address)) } else { None }
    }

    /// The default of the register at `address`, which the run must hold.
    #[must_use]
    pub const fn default_at(&self, address: u8) -> u8 {
        let index = if self.per_joint { address.wrapping_sub(self.address) } else { 0 };
        match self.defaults.as_slice().split_at_checked(index as usize) {
            Some((_, [value, ..])) => *value,
            _ => 0,
        }
    }
}

/// Is the table in ascending order, ROM before EEPROM before RAM, without overlap, inside the address space,
/// per-joint rows seven long, and every default a value of its row's range? Checked when the table is compiled.
#[must_use]
pub const fn well_formed(map: &[Register]) -> bool {
    let mut rest = map;
    let mut next = 0;
    let mut region = Region::Rom;
    while let [row, tail @ ..] = rest {
        let end = row.address as usize + row.count as usize;
        let shape_is_right = row.count > 0 && (!row.per_joint || row.count as usize == JOINTS);
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
    }

    #[test]
    fn joints_are_numbered_from_one() {
        assert_eq!(Joint::new(0), None);
        assert_eq!(Joint::new(8), None);
        assert_eq!(Joint::new(7).map(Joint::index), Some(6));
        assert_eq!(Joint::from_index(7), None);
        let numbers: Vec<u8> = Joint::ALL.iter().map(|joint| joint.number()).collect();
        assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(Joint::ALL.iter().fold(0, |bits, joint| bits | joint.bit()), 0x7F);
    }

    #[test]
    fn a_row_knows_its_addresses() {
        let row = ram(46).each_joint().default_each([1, 2, 3, 4, 5, 6, 7]);
        assert!(row.holds(46) && row.holds(52) && !row.holds(45) && !row.holds(53));
        assert_eq!(row.joint_at(48), Joint::new(3));
        assert_eq!(row.joint_at(53), None);
        assert_eq!(row.joint_at(45), None);
        assert_eq!(row.default_at(48), 3);
        assert_eq!(ram(46).of(Joint::ALL[6]), 46, "a row without joints has one address");
    }

    #[test]
    fn a_row_is_what_it_was_said_to_be() {
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

    #[test]
    fn units_are_written_as_people_write_them() {
        let symbols = [Unit::None, Unit::SpeedStep, Unit::Decisecond, Unit::Hertz].map(Unit::symbol);
        assert_eq!(symbols, ["", "× 1.9 °/s", "× 100 ms", "Hz"]);
        let symbols = [Unit::Decivolt, Unit::Celsius, Unit::VersionTenths].map(Unit::symbol);
        assert_eq!(symbols, ["× 0.1 V", "°C", "× 0.1"]);
    }
}
