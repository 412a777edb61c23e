//! The current value of every register, and the check of writes of a host.
//!
//! A write is checked completely, then applied completely ([D15](crate::decisions#d15) to [D17](crate::decisions#d17)).
//! [`RegisterFile::check`] returns an [`Accepted`] write, which the arm can inspect before [`RegisterFile::apply`].
//! This file does not know frames or the effect of a value.

use super::accepted::{Accepted, from_map21};
use super::joint::{JOINTS, Joint};
use super::map::{CHIP_ID, EEPROM_LOCK, OFFSET, refusal};
use super::map21::{self, Map, OPTIONS, option};
use super::rules::{
    DEFAULTS, EEPROM_END, EEPROM_START, Refused, first_refused_value, keeps_bytes_of_21, rule, rule_21,
    rules_21_from, rules_from,
};
use super::spec::Register;

/// The bytes of the EEPROM region, which survive a power cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Image(#[cfg_attr(feature = "serde", serde(with = "serde_bytes"))] pub [u8; Image::LENGTH]);

impl Image {
    /// Bytes of the EEPROM region.
    pub const LENGTH: usize = (EEPROM_END - EEPROM_START) as usize;
}

/// The values of all 256 registers.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RegisterFile {
    #[cfg_attr(feature = "serde", serde(with = "serde_bytes"))]
    values: [u8; 256],
    /// The offsets in sign and magnitude while 13 to 19 show them as 128 + offset (M5).
    offsets: Option<[u8; JOINTS]>,
}

impl RegisterFile {
    /// The registers after power-up: defaults, the chip id (most significant byte first) and the stored settings. A
    /// stored value that is out of range is replaced by the default ([D19](crate::decisions#d19)).
    #[must_use]
    pub fn new(chip_id: [u8; CHIP_ID.count as usize], stored: Option<&Image>) -> Self {
        let mut file = Self { values: DEFAULTS, offsets: None };
        for (address, byte) in (CHIP_ID.address..).zip(chip_id) {
            file.set(address, byte);
        }
        let stored = stored.map_or([].as_slice(), |image| image.0.as_slice());
        for (address, &byte) in (EEPROM_START..).zip(stored) {
            // Register 20 has no rule in map 2.2.
            let rule = if rule(address).is_open() { rule(address) } else { rule_21(address) };
            if rule.is_open() && rule.allows(byte) {
                file.set(address, byte);
            }
        }
        file.forget_last_write();
        file
    }

    /// Shows the offsets in the encoding that bit 0 of register 20 selects, as before the first write
    /// ([M5](crate::decisions#m5), [M12](crate::decisions#m12)).
    pub fn forget_last_write(&mut self) {
        let is_biased = self.get(OPTIONS.address) & option::BIASED_OFFSETS != 0;
        self.show_offsets(if is_biased { Map::V21 } else { Map::V22 });
    }

    /// Shows the offsets in the encoding of a map.
    fn show_offsets(&mut self, map: Map) {
        if let Some(offsets) = self.offsets.take() {
            self.set_offsets(offsets);
        }
        if map == Map::V21 {
            let offsets = Joint::ALL.map(|joint| self.get(OFFSET.of(joint)));
            self.set_offsets(offsets.map(to_map21));
            self.offsets = Some(offsets);
        }
    }

    fn set_offsets(&mut self, bytes: [u8; JOINTS]) {
        for (joint, byte) in Joint::ALL.into_iter().zip(bytes) {
            self.set(OFFSET.of(joint), byte);
        }
    }

    /// A joint's offset in degrees, -16 to 16.
    #[must_use]
    pub fn offset(&self, joint: Joint) -> i8 {
        let shown = self.get(OFFSET.of(joint));
        let range = if self.offsets.is_some() { map21::OFFSET.range } else { OFFSET.range };
        i8::try_from(range.decode_byte(shown)).unwrap_or(0)
    }

    /// The stored value of the register at `address`. An offset is in sign and magnitude, whatever 13 to 19 show.
    fn setting(&self, address: u8) -> u8 {
        let offset =
            |offsets: &[u8; JOINTS]| offsets.get(usize::from(address.wrapping_sub(OFFSET.address))).copied();
        self.offsets.as_ref().and_then(offset).unwrap_or_else(|| self.get(address))
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

    /// Sets a two-byte register from the arm's side, without any rule.
    pub fn set_word(&mut self, address: u8, word: u16) {
        for (address, byte) in (address..=u8::MAX).zip(word.to_le_bytes()) {
            self.set(address, byte);
        }
    }

    /// The value of the two-byte register at `address`.
    #[must_use]
    pub fn word(&self, address: u8) -> u16 {
        u16::from_le_bytes([self.get(address), self.get(address.wrapping_add(1))])
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

    /// The values of `count` registers from `address` on; empty if the range ends beyond address 255, which the frame
    /// parser rejects ([D2](crate::decisions#d2)).
    #[must_use]
    pub fn read(&self, address: u8, count: u8) -> &[u8] {
        let start = usize::from(address);
        self.values.get(start..start + usize::from(count)).unwrap_or(&[])
    }

    /// Checks a write of the host in map 2.2 without applying it.
    ///
    /// # Errors
    /// [`Refused`] with the first register whose value is out of range, or that has two bytes while the write covers only one
    /// of them. Registers that the write cannot change are not checked.
    pub fn check<'a>(&self, address: u8, values: &'a [u8]) -> Result<Accepted<'a>, Refused> {
        let (start, values) = self.unlocked(address, values);
        let accepted = Accepted { map: Map::V22, start, values };
        let word = if accepted.is_extended() { first_refused_value(start, values) } else { None };
        for ((rule, &value), address) in rules_from(start).iter().zip(values).zip(start..) {
            if !rule.allows(value) {
                let byte = Refused { reason: refusal::OUT_OF_RANGE, address };
                return Err(word.filter(|word| word.address < address).unwrap_or(byte));
            }
        }
        word.map_or(Ok(accepted), Err)
    }

    /// Checks a write of the host in map 2.1 without applying it.
    ///
    /// # Errors
    /// [`Refused`] with the first register whose value is out of range. Registers that the write cannot change are not checked.
    pub fn check_map21<'a>(&self, address: u8, values: &'a [u8]) -> Result<Accepted<'a>, Refused> {
        let (start, values) = self.unlocked(address, values);
        for ((rule, &value), address) in rules_21_from(start).iter().zip(values).zip(start..) {
            if !rule.allows_21(value) {
                return Err(Refused { reason: refusal::OUT_OF_RANGE, address });
            }
        }
        Ok(Accepted { map: Map::V21, start, values })
    }

    /// The part of a write that can have an effect, with its first address: the part from the EEPROM region on, or from the
    /// end of that region while it is locked.
    fn unlocked<'a>(&self, address: u8, values: &'a [u8]) -> (u8, &'a [u8]) {
        let is_locked = self.get(EEPROM_LOCK.address) != 0;
        let start = address.max(if is_locked { EEPROM_END } else { EEPROM_START });
        (start, values.get(usize::from(start - address)..).unwrap_or(&[]))
    }

    /// Applies a checked write. Registers on which a write has no effect keep their values, but 13 to 19 show the offsets in
    /// the encoding of the write's map ([M5](crate::decisions#m5)).
    pub fn apply(&mut self, accepted: &Accepted<'_>) {
        if self.offsets.is_some() {
            self.show_offsets(Map::V22);
        }
        if accepted.map == Map::V21 {
            return self.apply_map21(accepted);
        }
        let slots = self.values.get_mut(usize::from(accepted.start)..).unwrap_or(&mut []);
        for ((rule, slot), &value) in rules_from(accepted.start).iter().zip(slots).zip(accepted.values) {
            if rule.is_open() {
                *slot = value;
            }
        }
    }

    fn apply_map21(&mut self, accepted: &Accepted<'_>) {
        for (&value, address) in accepted.values.iter().zip(accepted.start..=u8::MAX) {
            if rule_21(address).is_open() && keeps_bytes_of_21(address) {
                self.set(address, from_map21(address, value));
            }
        }
        self.show_offsets(Map::V21);
    }

    /// The present values of the EEPROM region, with the offsets in sign and magnitude.
    #[must_use]
    pub fn image(&self) -> Image {
        let mut image = Image([0; Image::LENGTH]);
        for (byte, address) in image.0.iter_mut().zip(EEPROM_START..) {
            *byte = self.setting(address);
        }
        image
    }

    /// The first register of the EEPROM region that this write would change, if any.
    #[must_use]
    pub fn first_changed_setting(&self, accepted: &Accepted<'_>) -> Option<u8> {
        let is_change =
            |address: &u8| accepted.value_at(*address).is_some_and(|new| new != self.setting(*address));
        (accepted.start..EEPROM_END).find(is_change)
    }
}

/// Converts an offset from sign and magnitude to 128 + offset.
fn to_map21(byte: u8) -> u8 {
    map21::OFFSET.range.encode_byte(OFFSET.range.decode_byte(byte)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::map::{BAUD_RATE, DEVICE_ID, FRAMES_ACCEPTED, OFFSET, SPEED, TARGET_POSITION};
    use super::*;

    fn fresh() -> RegisterFile {
        RegisterFile::new([1, 2, 3, 4, 5, 6], None)
    }

    fn write(file: &mut RegisterFile, address: u8, values: &[u8]) -> Result<(), Refused> {
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
        assert_eq!(file.read(61, 22), [0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(file.read(83, 15), [0, 0, 0, 0, 0, 0, 0, 0, 128, 128, 128, 128, 128, 128, 128]);
        assert_eq!(file.read(98, 30), [0; 30]);
        let targets = [9_000_u16, 9_000, 6_500, 9_000, 9_000, 9_000, 8_000].map(u16::to_le_bytes);
        assert_eq!(file.read(128, 14), targets.as_flattened());
        assert_eq!((file.read(142, 14), file.read(156, 35)), ([0xFF; 14].as_slice(), [0; 35].as_slice()));
        assert_eq!(file.read(191, 9), [1, 1, 70, 40, 0, 0, 0, 0, 1]);
        assert_eq!(file.read(200, 40), [0; 40]);
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
    fn d22_a_word_is_written_whole() {
        let mut file = fresh();
        let half = |address| Err(Refused { reason: refusal::HALF_A_WORD, address });
        let wrong = |address| Err(Refused { reason: refusal::OUT_OF_RANGE, address });
        assert_eq!(write(&mut file, 129, &[1]), half(128));
        assert_eq!(write(&mut file, 127, &[1, 1]), half(128), "127 has no effect");
        assert_eq!(write(&mut file, 128, &[1, 1, 1]), half(130));
        assert_eq!(write(&mut file, 184, &[4, 0]), wrong(184));
        assert_eq!(write(&mut file, 185, &[0, 0, 2]), half(184), "before 187");
        assert_eq!(write(&mut file, 184, &[5, 0, 0, 2]), wrong(187));
        assert_eq!(write(&mut file, 53, &[&[51], [0; 130].as_slice()].concat()), wrong(53), "before 184");
        assert_eq!(write(&mut file, 128, &[0x51, 0x46]), wrong(128), "18001");
        assert_eq!(write(&mut file, 141, &[1, 2, 3]), half(140), "142 is read only");
        assert_eq!(write(&mut file, 143, &[1; 41]), Ok(()), "all of it is read only");
        let written = [0x50, 0x46, 1, 0];
        assert_eq!((write(&mut file, 130, &written), file.read(130, 4)), (Ok(()), written.as_slice()));
        assert_eq!((file.word(130), file.word(132), file.word(255)), (18_000, 1, 0x0700));
    }

    #[test]
    fn d22_an_accepted_write_reports_its_words() {
        let mut file = fresh();
        let accepted = file.check(128, &[1, 2, 3, 4]).unwrap();
        assert_eq!(
            [128, 130, 132].map(|address| accepted.word_at(address)),
            [Some(0x201), Some(0x403), None]
        );
        assert!(accepted.is_extended() && !file.check(46, &[0; 82]).unwrap().is_extended());
        file.set_word(142, 0x1234);
        assert_eq!((file.word(142), file.read(142, 2)), (0x1234, [0x34, 0x12].as_slice()));
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
