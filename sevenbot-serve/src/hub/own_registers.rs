//! The registers that each client has for itself: the frequencies of its reports.
//!
//! A write to them is taken out of the frame, and a read of them is overlaid with the client's values. The other
//! registers of the frame pass unchanged.

use protocol_core::registers::map::{FEEDBACK_FREQUENCY, find};
use protocol_core::registers::{Access, Region, Register};
use protocol_core::wire::Function;

use super::stream::Stream;

/// The values of a client's own registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct OwnRegisters {
    /// Of the reports of map 2.2, in Hz.
    positions: u8,
}

impl OwnRegisters {
    /// The frequency of a stream, in Hz.
    pub(crate) const fn frequency(&self, stream: Stream) -> u8 {
        match stream {
            Stream::Positions => self.positions,
        }
    }

    /// Applies a write and sets the own registers in `values` to 0, as the arm has them. Returns whether a frequency
    /// may have changed. A frame that the arm will refuse (D16) has no effect here, and passes as it is.
    pub(crate) fn write(&mut self, function: Function, address: u8, values: &mut [u8]) -> bool {
        if function != Function::Write || is_refused(address, values) {
            return false;
        }
        match byte_at(address, values, &FEEDBACK_FREQUENCY) {
            Some(byte) => self.positions = std::mem::take(byte),
            None => return false,
        }
        true
    }

    /// Replaces the own registers in the reply to a read.
    pub(crate) fn overlay(&self, address: u8, values: &mut [u8]) {
        if let Some(byte) = byte_at(address, values, &FEEDBACK_FREQUENCY) {
            *byte = self.positions;
        }
    }
}

/// The byte of a register in the values from `address` on.
fn byte_at<'a>(address: u8, values: &'a mut [u8], register: &Register) -> Option<&'a mut u8> {
    values.get_mut(usize::from(register.address.checked_sub(address)?))
}

/// Does the arm refuse a frame, because a value in RAM is out of range? The EEPROM depends on the lock, which only the
/// arm knows.
fn is_refused(address: u8, values: &[u8]) -> bool {
    (address..).zip(values).any(|(address, &value)| {
        find(address).is_some_and(|row| {
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
