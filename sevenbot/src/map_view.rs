//! The registers of an arm as map 2.2 names them, whichever map the arm speaks.
//!
//! ```text
//!   callers: map 2.2 ──▶ MapView ──▶ the arm's own addresses and encodings
//!            map 2.2 ◀── MapView ◀──
//! ```
//!
//! In map 2.1 the present positions and their report frequency have other addresses, and the offsets another encoding.
//! Everything else that map 2.2 names is the same.

use protocol_core::registers::Register;
use protocol_core::registers::map::{FEEDBACK_FREQUENCY, OFFSET, PRESENT_POSITION, TIME};
use protocol_core::registers::map21::{
    ANGLE_FEEDBACK_FREQUENCY, Map, PRESENT_ANGLE, TIP_POSITION, WRIST_POSITION,
};

use crate::snapshot::Snapshot;
use crate::span::Span;

/// The maker's firmware shows this time until one is written: the low byte of its 1000 ms.
const STOCK_TIME_AT_START: u8 = 232;
/// 1000 ms as a value of the register.
const ONE_SECOND: u8 = 10;
/// In map 2.1 a stored offset of 0 is 128. 0 and 255 mean that there is none.
const OFFSET_ZERO: u8 = 128;

/// How an arm sees the registers of map 2.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MapView(pub(crate) Map);

impl MapView {
    /// The registers to read for these ones: a range that holds them all.
    pub(crate) fn read_span(self, span: Span) -> Span {
        let addresses = || span.addresses().map(|address| self.address(address));
        match (self.0, addresses().min(), addresses().max()) {
            (Map::V21, Some(first), Some(last)) => {
                Span::new(first, (last - first).saturating_add(1)).unwrap_or(span)
            }
            _ => span,
        }
    }

    /// What a read of [`MapView::read_span`] gives for these registers.
    pub(crate) fn view(self, answer: &Snapshot, span: Span) -> Snapshot {
        let value = |address| self.value(address, answer.at(self.address(address)));
        Snapshot { address: span.address(), values: span.addresses().map(value).collect() }
    }

    /// The writes that give these values to registers of map 2.2. Registers that map 2.1 uses for something else are left
    /// out.
    pub(crate) fn writes(self, address: u8, values: &[u8]) -> Vec<(u8, Vec<u8>)> {
        if self.0 == Map::V22 || values.is_empty() {
            return vec![(address, values.to_vec())];
        }
        let mut writes: Vec<(u8, Vec<u8>)> = Vec::new();
        for (address, &value) in (address..=u8::MAX).zip(values).filter(|(address, _)| !is_inverse(*address))
        {
            let (address, value) = (self.address(address), encode(address, value));
            match writes.last_mut() {
                Some((first, run)) if usize::from(*first) + run.len() == usize::from(address) => {
                    run.push(value)
                }
                _ => writes.push((address, vec![value])),
            }
        }
        writes
    }

    /// The registers of a report of the present positions.
    pub(crate) const fn report(self) -> Span {
        match self.0 {
            Map::V22 => Span::of(&PRESENT_POSITION),
            Map::V21 => Span::of(&PRESENT_ANGLE),
        }
    }

    /// Where the arm has this register.
    fn address(self, address: u8) -> u8 {
        let moved = [(&FEEDBACK_FREQUENCY, &ANGLE_FEEDBACK_FREQUENCY), (&PRESENT_POSITION, &PRESENT_ANGLE)];
        let new = moved.into_iter().find(|(old, _)| self.0 == Map::V21 && old.holds(address));
        new.map_or(address, |(old, new)| new.address + (address - old.address))
    }

    /// The value of a register of map 2.2, from the arm's own encoding.
    fn value(self, address: u8, value: u8) -> u8 {
        match () {
            () if self.0 == Map::V22 => value,
            () if OFFSET.holds(address) => offset_from_biased(value),
            () if TIME.holds(address) && value == STOCK_TIME_AT_START => ONE_SECOND,
            () => value,
        }
    }
}

/// Does a write there start inverse kinematics in map 2.1?
fn is_inverse(address: u8) -> bool {
    (TIP_POSITION.address..end(&WRIST_POSITION)).contains(&address)
}

fn end(row: &Register) -> u8 {
    row.address.saturating_add(row.count)
}

/// The value in map 2.1 of a register of map 2.2.
fn encode(address: u8, value: u8) -> u8 {
    if !OFFSET.holds(address) {
        return value;
    }
    let magnitude = value & !OFFSET_ZERO;
    if value & OFFSET_ZERO == 0 {
        OFFSET_ZERO.wrapping_add(magnitude)
    } else {
        OFFSET_ZERO.wrapping_sub(magnitude)
    }
}

/// Sign and magnitude (D9) of 128 + offset.
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

    const MAP_21: MapView = MapView(Map::V21);

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
        assert_eq!(MapView(Map::V22).read_span(joints), joints);
    }

    #[test]
    fn offsets_are_converted_in_both_directions() {
        let stored = [0, 255, 128, 129, 126, 144, 112];
        let shown = [0, 0, 0, 1, 0x82, 16, 0x90];
        let view = MAP_21.view(&Snapshot { address: 13, values: stored.to_vec() }, Span::of(&OFFSET));
        assert_eq!(view.values, shown);
        let [(address, written)] = &MAP_21.writes(13, &shown)[..] else { panic!("one write") };
        assert_eq!((*address, written.as_slice()), (13, &[128, 128, 128, 129, 126, 144, 112][..]));
    }

    #[test]
    fn a_write_never_starts_inverse_kinematics() {
        let values: Vec<u8> = (46..=90).collect();
        let writes = MAP_21.writes(46, &values);
        assert_eq!(writes[0], (46, (46..=52).collect()));
        assert_eq!(writes[1], (82, vec![53]), "the frequency of reports");
        assert!(writes[2..].iter().all(|(first, _)| *first >= 74), "{writes:?}");
        assert_eq!(MAP_21.writes(0, &[]), [(0, vec![])]);
    }
}
