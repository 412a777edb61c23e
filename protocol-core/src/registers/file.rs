//! The current value of every register, and the rules for writes of a host.
//!
//! A write is checked completely, then applied completely (D15 to D17). [`RegisterFile::check`] returns an [`Accepted`]
//! write, which the arm can inspect before [`RegisterFile::apply`]. This file does not know frames or the effect of a
//! value.

use super::map::{CHIP_ID, EEPROM_LOCK, MAP};
use super::spec::{Access, Range, Region, Register};

/// Address of the first EEPROM register.
const EEPROM_START: u8 = eeprom_bounds().0;
/// Address behind the last EEPROM register.
const EEPROM_END: u8 = eeprom_bounds().1;
/// Address behind the last register that a host can write.
const WRITABLE_END: usize = writable_end();

/// The rules of all addresses that can be written, generated from the table at compile time. The image holds two bytes
/// per register and none of the table's text.
static RULES: [Rule; WRITABLE_END] = rules();

/// The bytes of the EEPROM region, which survive a power cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Image(pub [u8; Image::LENGTH]);

impl Image {
    /// Bytes of the EEPROM region.
    pub const LENGTH: usize = (EEPROM_END - EEPROM_START) as usize;
}

/// The reason why a write has no effect: a byte is outside the range of its register (D16).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OutOfRange {
    /// The first such register.
    pub address: u8,
    /// The byte for that register.
    pub value: u8,
}

/// A write that was checked and may be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Accepted<'a> {
    /// The first address of the write that can have an effect: from the EEPROM region on, or from its end while locked.
    start: u8,
    values: &'a [u8],
}

impl Accepted<'_> {
    /// The new value of the register at `address`; `None` if the write does not include it or has no effect on it (D15).
    #[must_use]
    pub fn value_at(&self, address: u8) -> Option<u8> {
        let value = self.values.get(usize::from(address.checked_sub(self.start)?))?;
        RULES.get(usize::from(address))?.is_open().then_some(*value)
    }
}

/// The values of all 256 registers.
#[derive(Clone, Debug)]
pub struct RegisterFile {
    values: [u8; 256],
}

impl RegisterFile {
    /// The registers after power-up: defaults, the chip id (most significant byte first) and the stored settings. A
    /// stored value that is out of range is replaced by the default (D19).
    #[must_use]
    pub fn new(chip_id: [u8; CHIP_ID.count as usize], stored: Option<&Image>) -> Self {
        let mut file = Self { values: DEFAULTS };
        for (address, byte) in (CHIP_ID.address..).zip(chip_id) {
            file.set(address, byte);
        }
        let stored = stored.map_or([].as_slice(), |image| image.0.as_slice());
        let slots = file.values.iter_mut().zip(&RULES).skip(EEPROM_START.into());
        for ((value, rule), &byte) in slots.zip(stored) {
            if rule.is_open() && rule.allows(byte) {
                *value = byte;
            }
        }
        file
    }

    /// The value of the register at `address`.
    #[must_use]
    pub fn get(&self, address: u8) -> u8 {
        // A byte always indexes one of 256 values, so the compiler removes the default.
        self.values.get(usize::from(address)).copied().unwrap_or(0)
    }

    /// Sets a register from the arm's side, without any rule.
    pub fn set(&mut self, address: u8, value: u8) {
        if let Some(slot) = self.values.get_mut(usize::from(address)) {
            *slot = value;
        }
    }

    /// Increments a counter of two bytes, low byte first. The counter wraps.
    pub fn increment(&mut self, counter: &Register) {
        let low = self.get(counter.address).wrapping_add(1);
        self.set(counter.address, low);
        if low == 0 {
            let high = counter.address.wrapping_add(1);
            self.set(high, self.get(high).wrapping_add(1));
        }
    }

    /// The values of `count` registers from `address` on; empty if the range ends beyond address 255, which the frame parser
    /// rejects (D2).
    #[must_use]
    pub fn read(&self, address: u8, count: u8) -> &[u8] {
        let start = usize::from(address);
        self.values.get(start..start + usize::from(count)).unwrap_or(&[])
    }

    /// Checks a write from the host without applying it.
    ///
    /// # Errors
    /// The first byte that is outside the range of a register that can be written now.
    pub fn check<'a>(&self, address: u8, values: &'a [u8]) -> Result<Accepted<'a>, OutOfRange> {
        let is_locked = self.get(EEPROM_LOCK.address) != 0;
        let start = address.max(if is_locked { EEPROM_END } else { EEPROM_START });
        let values = values.get(usize::from(start - address)..).unwrap_or(&[]);
        for ((rule, &value), address) in rules_from(start).iter().zip(values).zip(start..) {
            if !rule.allows(value) {
                return Err(OutOfRange { address, value });
            }
        }
        Ok(Accepted { start, values })
    }

    /// Applies a checked write.
    pub fn apply(&mut self, accepted: &Accepted<'_>) {
        let slots = self.values.get_mut(usize::from(accepted.start)..).unwrap_or(&mut []);
        for ((rule, slot), &value) in rules_from(accepted.start).iter().zip(slots).zip(accepted.values) {
            if rule.is_open() {
                *slot = value;
            }
        }
    }

    /// The present values of the EEPROM region.
    #[must_use]
    pub fn image(&self) -> Image {
        let mut image = Image([0; Image::LENGTH]);
        for (byte, &value) in image.0.iter_mut().zip(self.values.iter().skip(EEPROM_START.into())) {
            *byte = value;
        }
        image
    }

    /// The first register of the EEPROM region that this write would change, if any.
    #[must_use]
    pub fn first_changed_setting(&self, accepted: &Accepted<'_>) -> Option<u8> {
        let is_change =
            |address: &u8| accepted.value_at(*address).is_some_and(|new| new != self.get(*address));
        (accepted.start..EEPROM_END).find(is_change)
    }
}

fn rules_from(start: u8) -> &'static [Rule] {
    RULES.get(usize::from(start)..).unwrap_or(&[])
}

/// The rule for a write to one register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Rule {
    /// The bits of the magnitude. If the mask is 0, a write has no effect.
    mask: u8,
    max: u8,
}

impl Rule {
    const CLOSED: Self = Self { mask: 0, max: 0 };

    const fn of(register: &Register) -> Self {
        match (register.access, register.range) {
            (Access::ReadWrite, Range::UpTo(max)) => Self { mask: 0xFF, max },
            (Access::ReadWrite, Range::SignMagnitude(max)) => Self { mask: 0x7F, max },
            _ => Self::CLOSED,
        }
    }

    const fn is_open(&self) -> bool {
        self.mask != 0
    }

    /// Returns whether the value is in range. A register without effect allows any value.
    const fn allows(&self, value: u8) -> bool {
        value & self.mask <= self.max
    }
}

// The functions below run at compile time and in a test. An index out of bounds is a build error, not a panic.

const fn writable_end() -> usize {
    let mut end = 0;
    let mut rest = MAP;
    while let [row, tail @ ..] = rest {
        if matches!(row.access, Access::ReadWrite) {
            end = row.address as usize + row.count as usize;
        }
        rest = tail;
    }
    end
}

const fn eeprom_bounds() -> (u8, u8) {
    let (mut start, mut end) = (0, 0);
    let mut rest = MAP;
    while let [row, tail @ ..] = rest {
        if matches!(row.region, Region::Eeprom) {
            if end == 0 {
                start = row.address;
            }
            end = row.address + row.count;
        }
        rest = tail;
    }
    (start, end)
}

#[allow(clippy::indexing_slicing)]
const fn rules() -> [Rule; WRITABLE_END] {
    let mut rules = [Rule::CLOSED; WRITABLE_END];
    let mut rest = MAP;
    while let [row, tail @ ..] = rest {
        let mut address = row.address as usize;
        while address < row.address as usize + row.count as usize && address < WRITABLE_END {
            rules[address] = Rule::of(row);
            address += 1;
        }
        rest = tail;
    }
    rules
}

/// The values of a new arm after power-up.
static DEFAULTS: [u8; 256] = defaults();

#[allow(clippy::indexing_slicing, clippy::cast_possible_truncation)]
const fn defaults() -> [u8; 256] {
    let mut values = [0; 256];
    let mut rest = MAP;
    while let [row, tail @ ..] = rest {
        let mut offset = 0;
        while offset < row.count as usize {
            let address = row.address as usize + offset;
            values[address] = row.default_at(address as u8);
            offset += 1;
        }
        rest = tail;
    }
    values
}

#[cfg(test)]
mod tests {
    use super::super::map::{BAUD_RATE, DEVICE_ID, FRAMES_ACCEPTED, OFFSET, SPEED, TARGET_POSITION};
    use super::super::spec::Joint;
    use super::*;

    fn fresh() -> RegisterFile {
        RegisterFile::new([1, 2, 3, 4, 5, 6], None)
    }

    fn write(file: &mut RegisterFile, address: u8, values: &[u8]) -> Result<(), OutOfRange> {
        let accepted = file.check(address, values)?;
        file.apply(&accepted);
        Ok(())
    }

    #[test]
    fn a_new_arm_has_the_defaults_of_the_table() {
        let file = fresh();
        assert_eq!(file.read(0, 8), [7, 30, 1, 2, 3, 4, 5, 6]);
        assert_eq!(file.read(28, 4), [1, 1, 0, 0]);
        assert_eq!(file.read(TARGET_POSITION.address, 7), [90, 90, 65, 90, 90, 90, 80]);
        assert_eq!(file.read(240, 1), [1]);
        assert_eq!(file.read(61, 179), [0; 179]);
    }

    /// Runs the compile-time functions at run time, so that coverage and mutation tests see them.
    #[test]
    fn the_rules_and_defaults_follow_from_the_table() {
        assert_eq!((writable_end(), eeprom_bounds()), (54, (8, 28)));
        let rules = rules();
        assert_eq!(rules.as_slice(), RULES.as_slice());
        assert_eq!(defaults(), DEFAULTS);
        let rule = |mask, max| Rule { mask, max };
        assert_eq!(rules[..9], [Rule::CLOSED; 9], "ROM and reserved registers");
        assert_eq!(rules[12..14], [rule(0xFF, 7), rule(0x7F, 16)]);
        assert_eq!(rules[28..30], [rule(0xFF, 1), rule(0xFF, 2)]);
    }

    #[test]
    fn stored_values_out_of_range_are_replaced_by_their_defaults() {
        let mut stored = Image([0xFF; Image::LENGTH]);
        stored.0[usize::from(DEVICE_ID.address) - usize::from(EEPROM_START)] = 42;
        stored.0[usize::from(OFFSET.address) - usize::from(EEPROM_START)] = 0x90;
        let file = RegisterFile::new([0; 6], Some(&stored));
        assert_eq!(file.get(DEVICE_ID.address), 42);
        assert_eq!(file.get(BAUD_RATE.address), 0);
        assert_eq!(file.read(OFFSET.address, 7), [0x90, 0, 0, 0, 0, 0, 0]);
        assert_eq!(file.read(20, 8), [0; 8], "reserved registers read 0 whatever is stored");
    }

    #[test]
    fn a_saved_image_is_loaded_unchanged() {
        let mut file = fresh();
        write(&mut file, EEPROM_LOCK.address, &[0]).unwrap();
        write(&mut file, DEVICE_ID.address, &[9, 3, 0x8A]).unwrap();
        let again = RegisterFile::new([0; 6], Some(&file.image()));
        assert_eq!(again.read(DEVICE_ID.address, 3), [9, 3, 0x8A]);
    }

    #[test]
    fn an_accepted_write_reports_its_effect() {
        let mut file = fresh();
        let locked = file.check(DEVICE_ID.address, &[5, 99, 99]).unwrap();
        assert_eq!(locked.value_at(DEVICE_ID.address), None, "EEPROM is locked (D15)");
        assert_eq!(file.first_changed_setting(&locked), None);
        write(&mut file, EEPROM_LOCK.address, &[0]).unwrap();
        let open = file.check(DEVICE_ID.address, &[5]).unwrap();
        assert_eq!(open.value_at(DEVICE_ID.address), Some(5));
        assert_eq!(open.value_at(BAUD_RATE.address), None, "past its end");
        assert_eq!(open.value_at(SPEED.of(Joint::ALL[0])), None, "before its start or past its end");
        assert_eq!(file.first_changed_setting(&open), Some(DEVICE_ID.address));
        file.apply(&open);
        assert_eq!(
            file.first_changed_setting(&open),
            None,
            "writing unchanged settings causes no flash wear (D19)"
        );
    }

    #[test]
    fn counters_carry_into_their_high_byte_and_wrap() {
        let mut file = fresh();
        for _ in 0..0x1_0000 + 257 {
            file.increment(&FRAMES_ACCEPTED);
        }
        assert_eq!(file.read(FRAMES_ACCEPTED.address, 2), [1, 1]);
    }

    #[test]
    fn a_range_past_the_end_reads_nothing() {
        assert_eq!(fresh().read(255, 1).len(), 1);
        assert!(fresh().read(255, 2).is_empty());
    }
}
