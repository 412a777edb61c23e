//! THE SECOND TABLE: the registers of map 2.1, which every later arm of the maker has (docs/protocol.md, section 8).
//!
//! Rows that mean the same in map 2.2 come from there. A write of function 04 obeys this table.

use super::map::{self, find};
use super::spec::{Register, eeprom, ram, well_formed};
use super::unit::Unit;

/// Turns rows into named constants with their doc comments.
macro_rules! rows {
    ($($(#[doc = $doc:literal])+ $name:ident = $row:expr;)+) => {
        $($(#[doc = $doc])+ pub const $name: Register = $row.described(stringify!($name), &[$($doc),+]);)+
    };
}

rows! {
    /// Assembly error of the joint, as in map 2.2. A write may hold 128 + offset, the offset, or 256 + a negative offset.
    /// A read gives 128 + offset if the last accepted write was in map 2.1, and sign and magnitude if it was in map 2.2
    /// (M5).
    OFFSET = eeprom(13).each_joint().biased(16).default(128).unit(Unit::Degree);
    /// Bits: 0 offsets read as 128 + offset until the first write, 1 alarm frames are sent (M6).
    OPTIONS = eeprom(20).up_to(3);
    /// Reserved by the maker.
    RESERVED_21 = eeprom(21).run(7).reserved();
    /// Length of the effector in the maker's source, which does not use it. A write has no effect.
    END_LENGTH = ram(53).reserved();
    /// Position of the tip for IK6 and IK7: x, y, z in millimetres, each plus 1024 as two bytes, high byte first. A read
    /// gives the present positions of map 2.2 (M3, M7).
    TIP_POSITION = ram(54).run(6);
    /// Direction of the tool for IK6 and IK7: x, y, z, each plus 128. A read of 60 gives the present position of joint 7
    /// (M3, M7).
    TOOL_DIRECTION = ram(60).run(3);
    /// Direction of the disc of joint 6 for IK7: x, y, z, each plus 128 (M7).
    DISC_DIRECTION = ram(63).run(3);
    /// 0: the maker's arm ignores its buttons. Stored, without effect (M8).
    BUTTON_ENABLE = ram(66).up_to(1).default(1);
    /// Position of the wrist for IK5: x, y, z in millimetres, each plus 1024 as two bytes, high byte first (M7).
    WRIST_POSITION = ram(68).run(6);
    /// Rate of the reports of present angles; 0: no reports. Limited by the baud rate (M4).
    ANGLE_FEEDBACK_FREQUENCY = ram(82).up_to(100).unit(Unit::Hertz);
    /// Measured position of the joint, as 54 to 60 of map 2.2.
    PRESENT_ANGLE = ram(83).each_joint().up_to(180).read_only().unit(Unit::Degree);
    /// Rate of the reports of present loads; 0: no reports. Limited by the baud rate (M4).
    LOAD_FEEDBACK_FREQUENCY = ram(90).up_to(100).unit(Unit::Hertz);
    /// Measured load of the joint: 128 + load. One unit is 0.8 % of the stall torque, and more than 128 pushes towards
    /// greater angles (M9).
    PRESENT_LOAD = ram(91).each_joint().read_only().default(128);
}

/// The whole table of map 2.1, in ascending order of address.
pub const MAP_21: &[Register] = &[
    map::DEVICE_CODE,
    map::FIRMWARE_VERSION,
    map::CHIP_ID,
    map::RESERVED_8,
    map::DEVICE_ID,
    map::BAUD_RATE,
    OFFSET,
    OPTIONS,
    RESERVED_21,
    map::EEPROM_LOCK,
    map::MOTOR_STATE,
    map::EFFECTOR_TYPE,
    map::VACUUM_PUMP,
    map::SPEED,
    map::TIME,
    map::TARGET_POSITION,
    END_LENGTH,
    TIP_POSITION,
    TOOL_DIRECTION,
    DISC_DIRECTION,
    BUTTON_ENABLE,
    WRIST_POSITION,
    ANGLE_FEEDBACK_FREQUENCY,
    PRESENT_ANGLE,
    LOAD_FEEDBACK_FREQUENCY,
    PRESENT_LOAD,
];

const _: () =
    assert!(well_formed(MAP_21), "the register table has an overlap, a wrong order or a bad default");

/// Added to a position in millimetres, for [`TIP_POSITION`] and [`WRIST_POSITION`].
pub const POSITION_ZERO: u16 = 1024;
/// Added to a component of a direction, for [`TOOL_DIRECTION`] and [`DISC_DIRECTION`].
pub const DIRECTION_ZERO: u8 = 128;

/// The bits of [`OPTIONS`].
pub mod option {
    /// Before the first write, offsets read as 128 + offset ([M5](crate::decisions#m5)).
    pub const BIASED_OFFSETS: u8 = 1 << 0;
    /// Alarm frames are sent ([M8](crate::decisions#m8)).
    pub const ALARMS: u8 = 1 << 1;
}

/// One of the maker's two maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Map {
    /// Map 2.2, written by function 06.
    V22,
    /// Map 2.1, written by function 04.
    V21,
}

impl Map {
    /// Both maps, 2.2 first.
    pub const ALL: [Self; 2] = [Self::V22, Self::V21];

    /// The version, as the maker names it.
    #[must_use]
    pub const fn version(self) -> &'static str {
        match self {
            Self::V22 => "2.2",
            Self::V21 => "2.1",
        }
    }

    /// The rows of the map, by rising address.
    #[must_use]
    pub const fn rows(self) -> &'static [Register] {
        match self {
            Self::V22 => map::MAP,
            Self::V21 => MAP_21,
        }
    }

    /// The row that holds `address` in this map; `None` if it has no such row.
    #[must_use]
    pub fn find(self, address: u8) -> Option<&'static Register> {
        self.rows().iter().find(|row| row.holds(address))
    }
}

/// The row whose value a read of `address` gives ([M3](crate::decisions#m3)): the row of map 2.2 or, if that is missing
/// or reserved, the row of map 2.1. A reserved row of map 2.2 comes last. `None` if neither map has a row.
#[must_use]
pub fn find_readable(address: u8) -> Option<&'static Register> {
    let open = |row: &&Register| row.access != super::Access::Reserved;
    find(address).filter(open).or_else(|| Map::V21.find(address)).or_else(|| find(address))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_has_its_version_and_its_rows() {
        assert_eq!(Map::ALL.map(Map::version), ["2.2", "2.1"]);
        assert_eq!(Map::ALL.map(Map::rows), [map::MAP, MAP_21]);
        assert_eq!(Map::V21.find(90), Some(&LOAD_FEEDBACK_FREQUENCY));
        assert_eq!(Map::V22.find(90), None);
    }

    #[test]
    fn golden_option_bits() {
        assert_eq!([option::BIASED_OFFSETS, option::ALARMS], [1, 2]);
    }

    #[test]
    fn a_builder_sets_the_range_of_the_offsets() {
        // In the tables, the builder runs at compile time only.
        assert_eq!(eeprom(13).biased(16).range, OFFSET.range);
    }
}
