//! The registers of an arm as map 2.2 names them, whichever map the arm speaks.
//!
//! ```text
//!   callers: map 2.2 ──▶ MapView ──▶ the arm's own addresses and encodings
//!            map 2.2 ◀── MapView ◀──
//! ```
//!
//! In map 2.1 the present positions and their report frequency have other addresses, and the offsets another encoding.
//! Everything else that map 2.2 names has the same address. The registers that only map 2.1 has keep their addresses. This
//! project's firmware serves both maps, so the function code of map 2.1 writes a register that only map 2.1 has.

use std::ops::RangeInclusive;

use protocol_core::registers::map::{
    FEEDBACK_FREQUENCY, FINE_POSITION, FINE_TARGET, LOAD, MAP, OFFSET, PRESENT_POSITION, PROTECTION_VERSION,
    TIME,
};
use protocol_core::registers::map21::{
    self, ANGLE_FEEDBACK_FREQUENCY, DISC_DIRECTION, LOAD_FEEDBACK_FREQUENCY, Map, OPTIONS, PRESENT_ANGLE,
    TIP_POSITION, TOOL_DIRECTION, WRIST_POSITION, find_readable,
};
use protocol_core::registers::{Access, Register};

use crate::identity::Firmware;
use host_link::{Snapshot, Span};

/// The value of a time register in the maker's firmware until a time is written: the low byte of 1000 ms.
const STOCK_TIME_AT_START: u8 = 232;
/// 1000 ms as a value of a time register, whose unit is 100 ms.
const ONE_SECOND: u8 = 10;
/// Map 2.1 stores an offset as 128 + offset. 0 and 255 mean that no offset is stored.
const OFFSET_ZERO: u8 = 128;
/// A byte that is no offset in any encoding of map 2.1.
const NO_OFFSET: u8 = 64;

/// The extended block and the protection block.
const OUR_BLOCKS: RangeInclusive<u8> = FINE_TARGET.address..=PROTECTION_VERSION.address;

/// Translates between the registers of map 2.2 and the map of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MapView {
    /// The map of the arm's frames.
    pub(crate) map: Map,
    /// The firmware of the arm. Ours serves both maps.
    pub(crate) firmware: Firmware,
}

/// One frame: the map of its function, the first register, and the values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct WriteFrame {
    pub(crate) map: Map,
    pub(crate) address: u8,
    pub(crate) values: Vec<u8>,
}

impl MapView {
    /// Does the arm have this register? Only a register that map 2.1 alone has, or one of 128 to 199, counts as missing.
    pub(crate) fn serves(self, address: u8) -> bool {
        let has_map21 = self.firmware == Firmware::Ours || self.map == Map::V21;
        // Register 20 (M6), the extended block (D21) and the protection block (D27) are this project's additions.
        let is_ours = OPTIONS.holds(address) || OUR_BLOCKS.contains(&address);
        (!is_only_map21(address) || has_map21) && (!is_ours || self.firmware == Firmware::Ours)
    }

    /// Does a write to this register make the arm move at once, even if it covers only a part of a position? Ours moves only
    /// when a frame covers a whole position (M7).
    pub(crate) fn starts_inverse(self, address: u8) -> bool {
        self.firmware != Firmware::Ours && self.map == Map::V21 && is_inverse(address)
    }

    /// The range of the arm's addresses that holds these registers of map 2.2.
    pub(crate) fn read_span(self, span: Span) -> Span {
        let addresses = || span.addresses().map(|address| self.address(address));
        match (self.map, addresses().min(), addresses().max()) {
            (Map::V21, Some(first), Some(last)) => {
                Span::new(first, (last - first).saturating_add(1)).unwrap_or(span)
            }
            _ => span,
        }
    }

    /// The values of these registers of map 2.2, from the answer to a read of [`MapView::read_span`].
    pub(crate) fn view(self, answer: &Snapshot, span: Span) -> Snapshot {
        let value = |address| self.value(address, answer.at(self.address(address)));
        Snapshot { address: span.address(), values: span.addresses().map(value).collect() }
    }

    /// The frames that write these values: one for each run of neighbouring addresses of the arm with the same function code.
    /// Registers that the arm must not get are left out: [`Self::skips`].
    pub(crate) fn writes(self, address: u8, values: &[u8]) -> Vec<WriteFrame> {
        if values.is_empty() {
            return vec![WriteFrame { map: self.map, address, values: Vec::new() }];
        }
        let default = self.default_map(address, values.len());
        let mut frames: Vec<WriteFrame> = Vec::new();
        for (address, &value) in (address..=u8::MAX).zip(values).filter(|(address, _)| !self.skips(*address))
        {
            let map = if self.writes_by_map21(address) { Map::V21 } else { default };
            let value = if map == Map::V21 { encode(address, value) } else { value };
            let address = self.address(address);
            match frames.last_mut() {
                Some(last) if last.map == map && last.end() == usize::from(address) => {
                    last.values.push(value)
                }
                _ => frames.push(WriteFrame { map, address, values: vec![value] }),
            }
        }
        frames
    }

    /// Does this write end the reports of [`FEEDBACK_FREQUENCY`] (M4) without starting reports of map 2.1?
    pub(crate) fn ends_reports(self, address: u8, values: &[u8]) -> bool {
        let starts_others = |frame: &WriteFrame| {
            [ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY].iter().any(|row| {
                let index = row.address.checked_sub(frame.address).map(usize::from);
                index.and_then(|index| frame.values.get(index)).is_some_and(|&hertz| hertz != 0)
            })
        };
        let frames = self.writes(address, values);
        let mut of_map21 = frames.iter().filter(|frame| frame.map == Map::V21).peekable();
        self.map == Map::V22 && of_map21.peek().is_some() && !of_map21.any(starts_others)
    }

    /// The map for registers that both maps have. If the write also has registers of map 2.1 only, and none of map 2.2 only, it
    /// is map 2.1, so that one frame holds all.
    fn default_map(self, address: u8, count: usize) -> Map {
        let has = |test: &dyn Fn(u8) -> bool| (address..=u8::MAX).take(count).any(test);
        let is_only_map22 = |address| {
            FEEDBACK_FREQUENCY.holds(address)
                || PRESENT_POSITION.holds(address)
                || OUR_BLOCKS.contains(&address)
        };
        match self.map {
            Map::V22 if has(&|address| self.writes_by_map21(address)) && !has(&is_only_map22) => Map::V21,
            map => map,
        }
    }

    /// Is this register always written with the function of map 2.1?
    fn writes_by_map21(self, address: u8) -> bool {
        self.map == Map::V21 || self.firmware == Firmware::Ours && is_only_map21(address)
    }

    /// Is this register left out of writes? In map 2.1 the addresses of the present positions belong to the tip, and other
    /// firmware than ours moves the arm at any write to a part of a position.
    fn skips(self, address: u8) -> bool {
        self.map == Map::V21 && (PRESENT_POSITION.holds(address) || self.starts_inverse(address))
    }

    /// The ranges of registers in reports of positions. The reports of loads in map 2.1 are not among them.
    pub(crate) const fn reports(self) -> &'static [Span] {
        match self.map {
            // One range for each value of register 189 (D26), from 0 on.
            Map::V22 => {
                const {
                    &[
                        Span::of(&PRESENT_POSITION),
                        Span::of(&FINE_POSITION),
                        Span::between(&FINE_POSITION, &LOAD),
                    ]
                }
            }
            Map::V21 => const { &[Span::of(&PRESENT_ANGLE)] },
        }
    }

    /// The arm's own address of this register of map 2.2.
    fn address(self, address: u8) -> u8 {
        let moved = [(&FEEDBACK_FREQUENCY, &ANGLE_FEEDBACK_FREQUENCY), (&PRESENT_POSITION, &PRESENT_ANGLE)];
        let new = moved.into_iter().find(|(old, _)| self.map == Map::V21 && old.holds(address));
        new.map_or(address, |(old, new)| new.address + (address - old.address))
    }

    /// The value of a register of map 2.2, from the arm's own encoding.
    fn value(self, address: u8, value: u8) -> u8 {
        match () {
            () if self.map == Map::V22 => value,
            () if OFFSET.holds(address) => offset_from_biased(value),
            () if TIME.holds(address) && value == STOCK_TIME_AT_START => ONE_SECOND,
            () => value,
        }
    }
}

impl WriteFrame {
    /// The address behind the last register.
    fn end(&self) -> usize {
        usize::from(self.address) + self.values.len()
    }
}

/// Is this a register that a read shows (M3), and that map 2.2 lacks?
fn is_only_map21(address: u8) -> bool {
    let is_only = |row: &Register| row.access != Access::Reserved && !MAP.contains(row);
    find_readable(address).is_some_and(is_only)
}

/// Is this a part of a position or a direction for inverse kinematics in map 2.1?
fn is_inverse(address: u8) -> bool {
    [TIP_POSITION, TOOL_DIRECTION, DISC_DIRECTION, WRIST_POSITION].iter().any(|row| row.holds(address))
}

/// The value in map 2.1 of a register of map 2.2.
fn encode(address: u8, value: u8) -> u8 {
    if !OFFSET.holds(address) {
        return value;
    }
    map21::OFFSET.range.encode_byte(OFFSET.range.decode_byte(value)).unwrap_or(NO_OFFSET)
}

/// Converts an offset from 128 + offset to sign and magnitude (D9).
fn offset_from_biased(value: u8) -> u8 {
    match value {
        0 | u8::MAX => 0,
        OFFSET_ZERO.. => value - OFFSET_ZERO,
        _ => OFFSET_ZERO | (OFFSET_ZERO - value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::{MOTOR_STATE, TARGET_POSITION};

    /// An arm of the maker with map 2.1.
    const MAP_21: MapView = MapView { map: Map::V21, firmware: Firmware::Makers };
    /// This project's firmware, which serves both maps.
    const BOTH: MapView = MapView { map: Map::V22, firmware: Firmware::Ours };
    /// An arm of the maker with map 2.2.
    const MAP_22: MapView = MapView { map: Map::V22, firmware: Firmware::Makers };

    fn frame(map: Map, address: u8, values: impl IntoIterator<Item = u8>) -> WriteFrame {
        WriteFrame { map, address, values: values.into_iter().collect() }
    }

    #[test]
    fn one_read_holds_all_joints() {
        let joints = Span::between(&MOTOR_STATE, &PRESENT_POSITION);
        let read = MAP_21.read_span(joints);
        assert_eq!((read.address(), read.count()), (29, 61), "29..89");
        let values = (29..90).collect();
        let view = MAP_21.view(&Snapshot { address: 29, values }, joints);
        assert_eq!(view.joints(&PRESENT_POSITION), [83, 84, 85, 86, 87, 88, 89]);
        assert_eq!((view.byte(&FEEDBACK_FREQUENCY), view.byte(&MOTOR_STATE)), (82, 29));
        assert_eq!(MAP_21.read_span(Span::of(&TARGET_POSITION)), Span::of(&TARGET_POSITION));
        assert_eq!(BOTH.read_span(joints), joints);
    }

    #[test]
    fn offsets_are_converted_in_both_directions() {
        let stored = [0, 255, 128, 129, 126, 144, 112];
        let shown = [0, 0, 0, 1, 0x82, 16, 0x90];
        let view = MAP_21.view(&Snapshot { address: 13, values: stored.to_vec() }, Span::of(&OFFSET));
        assert_eq!(view.values, shown);
        let written = MAP_21.writes(13, &shown);
        assert_eq!(written, [frame(Map::V21, 13, [128, 128, 128, 129, 126, 144, 112])]);
        assert_eq!(
            MAP_21.writes(13, &[127]),
            [frame(Map::V21, 13, [64])],
            "127 is no offset, and 64 neither"
        );
    }

    #[test]
    fn a_write_never_starts_inverse_kinematics_of_the_maker() {
        let values: Vec<u8> = (46..=90).collect();
        let writes = MAP_21.writes(46, &values);
        assert_eq!(writes[0], frame(Map::V21, 46, 46..=52));
        assert_eq!(writes[1], frame(Map::V21, 82, [53]), "the frequency of reports");
        assert_eq!(writes[2].address, 66, "{writes:?}");
        assert!(writes[3..].iter().all(|frame| frame.address >= 74), "{writes:?}");
        assert_eq!(MAP_21.writes(0, &[]), [frame(Map::V21, 0, [])]);
        let moving: Vec<u8> = (0..=255).filter(|&address| MAP_21.starts_inverse(address)).collect();
        assert_eq!(moving, (54..=65).chain(68..=73).collect::<Vec<u8>>());
        assert!((0..=255).all(|address| !BOTH.starts_inverse(address)));
    }

    #[test]
    fn a_register_of_map_21_is_written_by_its_function() {
        for address in (61..=66).chain(68..=73).chain([20, 82, 90]) {
            assert_eq!(BOTH.writes(address, &[2]), [frame(Map::V21, address, [2])]);
            assert_eq!(MAP_22.writes(address, &[2]), [frame(Map::V22, address, [2])]);
        }
        for address in (11..20).chain(28..=53).chain([21, 67]) {
            assert_eq!(BOTH.writes(address, &[2]), [frame(Map::V22, address, [2])]);
        }
    }

    #[test]
    fn all_settings_are_in_one_frame() {
        let settings = [42, 3, 0, 0x85, 0, 0, 0, 0, 16, 2];
        let frames = BOTH.writes(11, &settings);
        assert_eq!(frames, [frame(Map::V21, 11, [42, 3, 128, 123, 128, 128, 128, 128, 144, 2])]);
        assert_eq!(BOTH.writes(11, &settings[..9]), [frame(Map::V22, 11, settings[..9].to_vec())]);
        let mixed = BOTH.writes(52, &(52..=66).collect::<Vec<u8>>());
        assert_eq!(mixed, [frame(Map::V22, 52, 52..=60), frame(Map::V21, 61, 61..=66)]);
        let frames = BOTH.writes(97, &(97..=130).collect::<Vec<u8>>());
        assert_eq!(frames, [frame(Map::V21, 97, 97..=97), frame(Map::V22, 98, 98..=130)]);
    }

    #[test]
    fn an_arm_serves_the_registers_of_its_firmware() {
        let missing = |view: MapView| (0..=255).filter(|&address| !view.serves(address)).collect::<Vec<u8>>();
        assert_eq!(missing(BOTH), []);
        assert_eq!(missing(MAP_21), [20].into_iter().chain(128..=199).collect::<Vec<u8>>());
        let only_map21 = [20].into_iter().chain(61..=66).chain(68..=73).chain(82..=97).chain(128..=199);
        assert_eq!(missing(MAP_22), only_map21.collect::<Vec<u8>>());
    }

    #[test]
    fn a_write_of_map_21_ends_the_reports_of_map_22() {
        assert!(BOTH.ends_reports(20, &[1]) && BOTH.ends_reports(82, &[0]));
        assert!(!BOTH.ends_reports(82, &[30]) && !BOTH.ends_reports(90, &[1]), "other reports");
        assert!(!BOTH.ends_reports(46, &[90]) && !MAP_21.ends_reports(66, &[1]));
    }
}
