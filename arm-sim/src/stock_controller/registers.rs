//! The registers of the maker's firmware 2.1.4: stored without range checks.

use alloc::vec::Vec;

use motion_core::calibration::angle_from_counts;
use motion_core::servo_bus::frame::Reading;
use protocol_core::registers::map::{
    BAUD_RATE, CHIP_ID, DEVICE_CODE, DEVICE_ID, EEPROM_LOCK, FIRMWARE_VERSION, MOTOR_STATE, OFFSET, SPEED,
    TARGET_POSITION, TIME,
};
use protocol_core::registers::{Image, JOINTS, Joint, Register};

use protocol_core::registers::map21::{
    ANGLE_FEEDBACK_FREQUENCY, BUTTON_ENABLE, LOAD_FEEDBACK_FREQUENCY, PRESENT_ANGLE, PRESENT_LOAD,
};

/// Number of registers: 0 to 99.
const COUNT: usize = 100;
/// The version in tenths: 2.1.
const VERSION: u8 = 21;
/// The maker's firmware starts with a speed of 600 and a time of 1000 ms, and keeps their low bytes.
const SPEED_AT_START: u8 = 88;
const TIME_AT_START: u8 = 232;
/// The first register of an [`Image`].
const IMAGE_START: u8 = CHIP_ID.address + CHIP_ID.count;

#[derive(Clone, Debug)]
pub(super) struct StockRegisters {
    values: [u8; COUNT],
    /// The offsets in effect: those that were stored at the start. A written offset acts from the next start on.
    offsets: [i8; JOINTS],
}

impl StockRegisters {
    /// The registers after power-up. A stored value that was never written is 255.
    pub(super) fn new(chip_id: [u8; 6], stored: Option<&Image>) -> Self {
        let mut registers = Self { values: [0; COUNT], offsets: [0; JOINTS] };
        registers.set(DEVICE_CODE.address, DEVICE_CODE.default_at(DEVICE_CODE.address));
        registers.set(FIRMWARE_VERSION.address, VERSION);
        registers.set_all(CHIP_ID.address, &chip_id);
        for address in stored_addresses() {
            let stored = stored.and_then(|image| image.0.get(usize::from(address - IMAGE_START)));
            registers.set(address, stored.copied().unwrap_or(0xFF));
        }
        registers.offsets = registers.joints(&OFFSET).map(offset);
        registers.set(EEPROM_LOCK.address, 1);
        registers.set(MOTOR_STATE.address, 1);
        registers.set_all(SPEED.address, &[SPEED_AT_START; JOINTS]);
        registers.set_all(TIME.address, &[TIME_AT_START; JOINTS]);
        let pose = Joint::ALL.map(|joint| TARGET_POSITION.default_at(TARGET_POSITION.of(joint)));
        registers.set_all(TARGET_POSITION.address, &pose);
        registers.set(BUTTON_ENABLE.address, 1);
        registers
    }

    /// The value of a register. Registers past the table read 0; the maker's firmware returns other memory.
    pub(super) fn get(&self, address: u8) -> u8 {
        self.values.get(usize::from(address)).copied().unwrap_or(0)
    }

    pub(super) fn joints(&self, row: &Register) -> [u8; JOINTS] {
        Joint::ALL.map(|joint| self.get(row.of(joint)))
    }

    fn set(&mut self, address: u8, value: u8) {
        if let Some(slot) = self.values.get_mut(usize::from(address)) {
            *slot = value;
        }
    }

    fn set_all(&mut self, first: u8, values: &[u8]) {
        (first..=u8::MAX).zip(values).for_each(|(address, &value)| self.set(address, value));
    }

    /// Writes the registers of a frame. Addresses 11 to 82 and 90 are written, and all others ignored.
    pub(super) fn write(&mut self, first: u8, values: &[u8]) {
        for (address, &value) in (first..=u8::MAX).zip(values) {
            let is_writable = (DEVICE_ID.address..=ANGLE_FEEDBACK_FREQUENCY.address).contains(&address)
                || address == LOAD_FEEDBACK_FREQUENCY.address;
            if is_writable {
                self.set(address, value);
            }
        }
    }

    /// The image to store after a write, with the registers that the write covers. `None` if the lock is closed after the write,
    /// or if nothing has changed.
    pub(super) fn image_after(&self, before: Image, first: u8, count: usize) -> Option<Image> {
        let covered = |address: &u8| usize::from(*address) < usize::from(first) + count && *address >= first;
        let mut image = before;
        for address in stored_addresses().filter(covered) {
            *image.0.get_mut(usize::from(address - IMAGE_START))? = self.get(address);
        }
        (self.get(EEPROM_LOCK.address) == 0 && image != before).then_some(image)
    }

    /// Takes a measurement: the angle, rounded and limited to 0 to 180 degrees, and the load.
    pub(super) fn measured(&mut self, joint: Joint, reading: &Reading) {
        let offset = self.offset(joint);
        let angle = angle_from_counts(joint, reading.position_counts, offset).nearest_degree();
        self.set(PRESENT_ANGLE.of(joint), angle);
        self.set(PRESENT_LOAD.of(joint), load(reading.load));
    }

    /// The offset of a joint in effect, in degrees.
    pub(super) fn offset(&self, joint: Joint) -> i8 {
        self.offsets.get(usize::from(joint.index())).copied().unwrap_or(0)
    }

    /// The values of `N` registers from `first` on.
    pub(super) fn bytes<const N: usize>(&self, first: u8) -> [u8; N] {
        let mut bytes = [0; N];
        for (byte, address) in bytes.iter_mut().zip(first..=u8::MAX) {
            *byte = self.get(address);
        }
        bytes
    }

    /// The values of `count` registers from `first` on; 0 past 255.
    pub(super) fn read(&self, first: u8, count: u8) -> Vec<u8> {
        (0..count).map(|index| first.checked_add(index).map_or(0, |address| self.get(address))).collect()
    }
}

fn stored_addresses() -> impl Iterator<Item = u8> {
    [DEVICE_ID.address, BAUD_RATE.address].into_iter().chain(Joint::ALL.map(|joint| OFFSET.of(joint)))
}

/// A stored offset is 128 + offset; 0 and 255 mean none.
fn offset(stored: u8) -> i8 {
    match stored {
        0 | 0xFF => 0,
        _ => stored.wrapping_sub(128).cast_signed(),
    }
}

/// Converts a load in 0.1 % to the value of the maker's firmware: 128 + load / 8. The firmware subtracts a servo's word with the
/// sign bit from 1023, so a negative load becomes 0.1 % more negative.
fn load(tenths: i16) -> u8 {
    let tenths = if tenths < 0 { tenths.saturating_sub(1) } else { tenths };
    u8::try_from(128 + tenths / 8).unwrap_or(if tenths < 0 { 0 } else { u8::MAX })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fresh_arm_has_the_makers_odd_defaults() {
        let registers = StockRegisters::new(*b"SIM\0\0\x01", None);
        assert_eq!(registers.read(0, 3), [7, 21, b'S']);
        assert_eq!(registers.read(11, 9), [0xFF; 9], "never written");
        assert_eq!(registers.read(28, 2), [1, 1]);
        assert_eq!((registers.get(32), registers.get(39)), (88, 232));
        assert_eq!(registers.read(46, 7), [90, 90, 65, 90, 90, 90, 80]);
        assert_eq!(registers.read(240, 16), [0; 16], "no status block");
    }

    #[test]
    fn offsets_are_biased_and_loads_are_in_units_of_8() {
        assert_eq!([0, 255, 128, 129, 126, 1].map(offset), [0, 0, 0, 1, -2, -127]);
        assert_eq!([0, 7, 8, 1000, -1, -7, -8, -1000].map(load), [128, 128, 129, 253, 128, 127, 127, 3]);
    }

    #[test]
    fn storage_depends_on_the_lock_after_the_frame() {
        let blank = Image([0xFF; Image::LENGTH]);
        let mut registers = StockRegisters::new([0; 6], None);
        registers.write(11, &[5]);
        assert_eq!(registers.get(11), 5, "the register changes");
        assert_eq!(registers.image_after(blank, 11, 1), None, "and only the storage is skipped");
        registers.write(28, &[0]);
        let image = registers.image_after(blank, 11, 1).expect("the lock is open");
        assert_eq!(StockRegisters::new([0; 6], Some(&image)).get(11), 5);
    }
}
