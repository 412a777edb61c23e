//! The registers that each client has for itself: the frequencies of its reports.
//!
//! A write to them is taken out of the frame, and a read of them is overlaid with the client's values. The other
//! registers of the frame pass unchanged.

use protocol_core::registers::map::FEEDBACK_FREQUENCY;
use protocol_core::registers::map21::{ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY, Map};
use protocol_core::registers::{Access, Region, Register};
use protocol_core::wire::Function;

use super::stream::Stream;

/// The values of a client's own registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct OwnRegisters {
    /// Of the reports of map 2.2, in Hz.
    positions: u8,
    /// Of the reports of present angles of map 2.1, in Hz.
    angles: u8,
    /// Of the reports of present loads of map 2.1, in Hz.
    loads: u8,
}

impl OwnRegisters {
    /// The frequency of a stream, in Hz.
    pub(crate) const fn frequency(&self, stream: Stream) -> u8 {
        match stream {
            Stream::Positions => self.positions,
            Stream::Angles => self.angles,
            Stream::Loads => self.loads,
        }
    }

    /// Applies a write and sets the own registers in `values` to 0, as the arm has them. Returns whether a frequency
    /// may have changed. A frame that the arm will refuse (D16) has no effect here, and passes as it is.
    pub(crate) fn write(&mut self, function: Function, address: u8, values: &mut [u8]) -> bool {
        let before = *self;
        match function {
            Function::Write if !is_refused(Map::V22, address, values) => self.write_map22(address, values),
            Function::WriteMap21 if !is_refused(Map::V21, address, values) => {
                self.write_map21(address, values);
            }
            _ => {}
        }
        *self != before
    }

    /// A write of 53 stops the reports of map 2.1 (M4).
    fn write_map22(&mut self, address: u8, values: &mut [u8]) {
        if let Some(byte) = byte_at(address, values, &FEEDBACK_FREQUENCY) {
            *self = Self { positions: std::mem::take(byte), ..Self::default() };
        }
    }

    /// Every write stops the reports of map 2.2 (M4).
    fn write_map21(&mut self, address: u8, values: &mut [u8]) {
        self.positions = 0;
        if let Some(byte) = byte_at(address, values, &ANGLE_FEEDBACK_FREQUENCY) {
            self.angles = std::mem::take(byte);
        }
        if let Some(byte) = byte_at(address, values, &LOAD_FEEDBACK_FREQUENCY) {
            self.loads = std::mem::take(byte);
        }
    }

    /// Replaces the own registers in the reply to a read.
    pub(crate) fn overlay(&self, address: u8, values: &mut [u8]) {
        let own = [
            (FEEDBACK_FREQUENCY, self.positions),
            (ANGLE_FEEDBACK_FREQUENCY, self.angles),
            (LOAD_FEEDBACK_FREQUENCY, self.loads),
        ];
        for (register, value) in own {
            if let Some(byte) = byte_at(address, values, &register) {
                *byte = value;
            }
        }
    }
}

/// The byte of a register in the values from `address` on.
fn byte_at<'a>(address: u8, values: &'a mut [u8], register: &Register) -> Option<&'a mut u8> {
    values.get_mut(usize::from(register.address.checked_sub(address)?))
}

/// Does the arm refuse a frame, because a value in RAM is out of range? The EEPROM depends on the lock, which only the
/// arm knows.
fn is_refused(map: Map, address: u8, values: &[u8]) -> bool {
    (address..).zip(values).any(|(address, &value)| {
        map.find(address).is_some_and(|row| {
            row.region == Region::Ram && row.access == Access::ReadWrite && !row.range.contains(value)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_keeps_its_own_byte_and_passes_the_others() {
        let mut own = OwnRegisters::default();
        let mut values = [90, 90, 65, 90, 90, 90, 80, 30];
        assert!(own.write(Function::Write, 46, &mut values));
        assert_eq!((own.frequency(Stream::Positions), values), (30, [90, 90, 65, 90, 90, 90, 80, 0]));
        let mut reply = [1, 2, 3];
        own.overlay(52, &mut reply);
        assert_eq!(reply, [1, 30, 3]);
        assert!(!own.write(Function::Write, 54, &mut [1]));
        assert!(!own.write(Function::Write, 46, &mut [90]));
    }

    fn frequencies(own: &OwnRegisters) -> [u8; 3] {
        Stream::ALL.map(|stream| own.frequency(stream))
    }

    #[test]
    fn the_streams_of_one_map_stop_those_of_the_other() {
        let mut own = OwnRegisters::default();
        let mut values = [30, 1, 2, 3, 4, 5, 6, 7, 5];
        assert!(own.write(Function::WriteMap21, 82, &mut values));
        assert_eq!((frequencies(&own), values), ([0, 30, 5], [0, 1, 2, 3, 4, 5, 6, 7, 0]));
        let mut reply = [9; 16];
        own.overlay(80, &mut reply);
        assert_eq!((reply[2], reply[10]), (30, 5));
        assert!(!own.write(Function::Write, 46, &mut [90]), "another register of map 2.2");
        assert!(own.write(Function::Write, 53, &mut [50]));
        assert_eq!(frequencies(&own), [50, 0, 0]);
        assert!(own.write(Function::WriteMap21, 0, &mut []), "no registers");
        assert_eq!(frequencies(&own), [0; 3]);
        assert!(!own.write(Function::WriteMap21, 53, &mut [50]), "the byte for 53 has no effect");
        assert!(!own.write(Function::Write, 82, &mut [50]), "not a register of map 2.2");
        assert!(own.write(Function::WriteMap21, 90, &mut [100]));
        assert!(!own.write(Function::WriteMap21, 81, &mut [0, 101]), "refused");
        assert_eq!(frequencies(&own), [0, 0, 100]);
        assert!(own.write(Function::Write, 53, &mut [0]));
        assert_eq!(frequencies(&own), [0; 3]);
    }

    #[test]
    fn a_frame_that_the_arm_refuses_changes_nothing() {
        let mut own = OwnRegisters::default();
        for mut values in [[90, 51], [181, 30]] {
            let before = values;
            assert!(!own.write(Function::Write, 52, &mut values));
            assert_eq!((own, values), (OwnRegisters::default(), before));
        }
    }
}
