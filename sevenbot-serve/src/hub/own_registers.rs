//! The registers that each client has for itself: the frequencies and the content of its reports.
//!
//! The server takes their values from a write, and sends 0 to the arm in their place. In the reply to a read it inserts the
//! client's values. This module leaves the other registers of the frame as they are.

use protocol_core::registers::map::{FEEDBACK_FREQUENCY, OFFSET, REPORT_CONTENT};
use protocol_core::registers::map21::{ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY};
use protocol_core::registers::{Map, Register};
use protocol_core::report_kind::ReportKind;

/// The values of a client's own registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct OwnRegisters {
    /// Frequency of the reports of map 2.2, in Hz.
    positions: u8,
    /// What these reports hold ([D26](protocol_core::decisions#d26)).
    content: u8,
    /// Frequency of the reports of present angles of map 2.1, in Hz.
    angles: u8,
    /// Frequency of the reports of present loads of map 2.1, in Hz.
    loads: u8,
    /// The map of the client's last write that the arm accepts. The arm's form of the offsets depends on it
    /// ([M5](protocol_core::decisions#m5)).
    last_map: Option<Map>,
}

impl OwnRegisters {
    /// The frequency of a stream, in Hz.
    pub(crate) const fn frequency(&self, stream: ReportKind) -> u8 {
        match stream {
            ReportKind::Positions | ReportKind::FinePositions | ReportKind::FineState => {
                if ReportKind::of_content(self.content).index() == stream.index() {
                    self.positions
                } else {
                    0
                }
            }
            ReportKind::Angles => self.angles,
            ReportKind::Loads => self.loads,
        }
    }

    /// Applies a write that the arm accepts, and sets the own registers in `values` to 0, as the arm has them. Returns
    /// whether a frequency may have changed.
    pub(crate) fn write(&mut self, map: Map, address: u8, values: &mut [u8]) -> bool {
        let before = *self;
        self.last_map = Some(map);
        match map {
            Map::V22 => self.write_map22(address, values),
            Map::V21 => self.write_map21(address, values),
        }
        *self != before
    }

    /// The map that determines the form of the offsets in the reply to this read: the map of the client's last accepted write, or
    /// `before_writes`. `None` if the read has no offsets.
    pub(crate) fn form_of_read(&self, address: u8, count: u8, before_writes: Map) -> Option<Map> {
        covers(&OFFSET, address, count.into()).then_some(self.last_map.unwrap_or(before_writes))
    }

    /// Applies a write in map 2.2. A write of register 53 stops the reports of map 2.1 ([M4](protocol_core::decisions#m4)).
    fn write_map22(&mut self, address: u8, values: &mut [u8]) {
        if let Some(byte) = byte_at(address, values, &FEEDBACK_FREQUENCY) {
            *self = Self { positions: std::mem::take(byte), angles: 0, loads: 0, ..*self };
        }
        if let Some(byte) = byte_at(address, values, &REPORT_CONTENT) {
            self.content = std::mem::take(byte);
        }
    }

    /// Applies a write in map 2.1. Every such write stops the reports of map 2.2 ([M4](protocol_core::decisions#m4)).
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
            (REPORT_CONTENT, self.content),
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

/// Do the `count` registers from `address` on include one of this row?
pub(super) fn covers(row: &Register, address: u8, count: usize) -> bool {
    let (first, start) = (usize::from(row.address), usize::from(address));
    count > 0 && start < first + usize::from(row.count) && first < start + count
}

/// The byte of a register in the values from `address` on.
pub(super) fn byte_at<'a>(address: u8, values: &'a mut [u8], register: &Register) -> Option<&'a mut u8> {
    values.get_mut(usize::from(register.address.checked_sub(address)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_keeps_its_own_byte_and_passes_the_others() {
        let mut own = OwnRegisters::default();
        let mut values = [90, 90, 65, 90, 90, 90, 80, 30];
        assert!(own.write(Map::V22, 46, &mut values));
        assert_eq!((own.frequency(ReportKind::Positions), values), (30, [90, 90, 65, 90, 90, 90, 80, 0]));
        let mut reply = [1, 2, 3];
        own.overlay(52, &mut reply);
        assert_eq!(reply, [1, 30, 3]);
        assert!(!own.write(Map::V22, 54, &mut [1]));
        assert!(!own.write(Map::V22, 46, &mut [90]));
    }

    #[test]
    fn no_registers_include_none() {
        let targets = protocol_core::registers::map::TARGET_POSITION;
        assert!(covers(&targets, 45, 2) && covers(&targets, 52, 1));
        assert!(!covers(&targets, 45, 1) && !covers(&targets, 53, 1) && !covers(&targets, 47, 0));
    }

    fn frequencies(own: &OwnRegisters) -> [u8; 3] {
        [ReportKind::Positions, ReportKind::Angles, ReportKind::Loads].map(|stream| own.frequency(stream))
    }

    #[test]
    fn the_streams_of_one_map_stop_those_of_the_other() {
        let mut own = OwnRegisters::default();
        let mut values = [30, 1, 2, 3, 4, 5, 6, 7, 5];
        assert!(own.write(Map::V21, 82, &mut values));
        assert_eq!((frequencies(&own), values), ([0, 30, 5], [0, 1, 2, 3, 4, 5, 6, 7, 0]));
        let mut reply = [9; 16];
        own.overlay(80, &mut reply);
        assert_eq!((reply[2], reply[10]), (30, 5));
        assert!(!own.write(Map::V21, 46, &mut [90]), "another register");
        assert!(own.write(Map::V22, 53, &mut [50]));
        assert_eq!(frequencies(&own), [50, 0, 0]);
        assert!(own.write(Map::V21, 0, &mut []), "no registers");
        assert_eq!(frequencies(&own), [0; 3]);
        assert!(!own.write(Map::V21, 53, &mut [50]), "the byte for 53 has no effect");
        own.write(Map::V22, 82, &mut [50]);
        assert_eq!(frequencies(&own), [0; 3], "not a register of map 2.2");
        assert!(own.write(Map::V21, 90, &mut [100]));
        assert_eq!(frequencies(&own), [0, 0, 100]);
        assert!(own.write(Map::V22, 53, &mut [0]));
        assert_eq!(frequencies(&own), [0; 3]);
    }

    #[test]
    fn the_last_write_decides_the_form_of_the_offsets() {
        let mut own = OwnRegisters::default();
        for before_writes in Map::ALL {
            assert_eq!(own.form_of_read(13, 7, before_writes), Some(before_writes));
        }
        own.write(Map::V21, 0, &mut []);
        let form = Some(Map::V21);
        let reads = [(13, 7), (19, 1), (0, 255), (12, 2), (12, 1), (20, 9), (13, 0)];
        let forms = reads.map(|(address, count)| own.form_of_read(address, count, Map::V22));
        assert_eq!(forms, [form, form, form, form, None, None, None]);
        own.write(Map::V22, 0, &mut []);
        assert_eq!(own.form_of_read(0, 60, Map::V21), Some(Map::V22));
    }
}
