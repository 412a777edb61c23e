//! The rules of the extended block, from docs/protocol.md, section 9: values of writes, and positions that a read shows.

use motion_core::calibration::{MicroDegrees, angle_from_counts};
use protocol_core::registers::map::refusal;
use protocol_core::registers::{Joint, RegisterFile};

use crate::violation::{Check, ensure};

/// The first fine target, and the first address after the fine targets.
pub(crate) const FINE_TARGETS: (u8, u8) = (128, 142);
/// The first fine present position.
const FINE_POSITIONS: u8 = 142;
/// The set-point period, two bytes.
pub(crate) const PERIOD: u8 = 184;
/// The timeout of the host-link watchdog, in units of 10 ms, and its action: 0 holds, 1 damps (D24).
pub(crate) const WATCHDOG: u8 = 186;
pub(crate) const WATCHDOG_ACTION: u8 = 187;
/// The limits (D25).
pub(crate) const LIMITS: u8 = 188;
/// The content of a report (D26).
pub(crate) const REPORT_CONTENT: u8 = 189;
/// The joints that were measured, bit n-1 = joint n.
const MEASURED: u8 = 190;
/// A fine position before the first reading.
const UNKNOWN: u16 = 65_535;

/// The address of the low byte if this is a byte of a writable two-byte register.
const fn low_byte(at: u8) -> Option<u8> {
    match at {
        128..=141 | 184 | 185 => Some(at & !1),
        _ => None,
    }
}

/// The reason to refuse a write because of the two-byte register that holds `at`, and the address of its low byte (D22).
/// `None` if the register is written whole with a value in range, or if it is no writable two-byte register.
pub(crate) fn word_offence(items: &[(u8, u8)], at: u8) -> Option<(u8, u8)> {
    let low = low_byte(at)?;
    let Some(value) = word(items, low) else { return Some((refusal::HALF_A_WORD, low)) };
    let is_in_range = if low == PERIOD { matches!(value, 0 | 5..=1_000) } else { value <= 18_000 };
    (!is_in_range).then_some((refusal::OUT_OF_RANGE, low))
}

/// True if this is a byte of a writable two-byte register.
pub(crate) const fn is_word(at: u8) -> bool {
    low_byte(at).is_some()
}

/// The value that a write gives to the two-byte register at `low`; `None` if the write does not cover both bytes.
fn word(items: &[(u8, u8)], low: u8) -> Option<u16> {
    let byte = |wanted| items.iter().find(|(at, _)| *at == wanted).map(|(_, value)| *value);
    Some(u16::from_le_bytes([byte(low)?, byte(low + 1)?]))
}

/// The address of a joint's fine target.
pub(crate) const fn fine_target(joint: Joint) -> u8 {
    FINE_TARGETS.0 + 2 * joint.index()
}

/// The fine targets in a write, in hundredths of a degree.
pub(crate) fn fine_targets(items: &[(u8, u8)]) -> impl Iterator<Item = (Joint, u16)> + use<'_> {
    Joint::ALL.into_iter().filter_map(|joint| Some((joint, word(items, fine_target(joint))?)))
}

/// Converts a fine target from hundredths of a degree to microdegrees.
pub(crate) fn angle(hundredths: u16) -> MicroDegrees {
    MicroDegrees(i32::from(hundredths) * 10_000)
}

/// Converts an angle of 0 to 180 degrees to a fine target: the nearest hundredth of a degree.
pub(crate) fn hundredths(angle: MicroDegrees) -> u16 {
    u16::try_from(angle.0.saturating_add(5_000) / 10_000).unwrap_or(0)
}

/// True if `count` registers from `address` on include the register `wanted`.
pub(crate) fn covers(address: u8, count: usize, wanted: u8) -> bool {
    wanted.checked_sub(address).is_some_and(|offset| usize::from(offset) < count)
}

/// The present position of a joint in hundredths of a degree, if it was measured.
pub(crate) fn fine_position(registers: &RegisterFile, joint: Joint) -> Option<u16> {
    Some(word_of(registers, FINE_POSITIONS + 2 * joint.index())).filter(|position| *position != UNKNOWN)
}

/// True if a frame to the host holds registers of the extended block. The arm computes them for such a frame.
pub(crate) fn shows_block(frame: &[u8]) -> bool {
    let [_, _, 3, first, count, ..] = frame else { return false };
    *count > 0 && *first < 192 && usize::from(*first) + usize::from(*count) > 128
}

/// A two-byte register of the arm.
pub(crate) fn word_of(registers: &RegisterFile, low: u8) -> u16 {
    u16::from_le_bytes([registers.get(low), registers.get(low + 1)])
}

/// Checks that both views of the present positions agree, and that register 190 tells which joints were measured (D21).
pub(crate) fn check_positions(registers: &RegisterFile) -> Check {
    for joint in Joint::ALL {
        let (number, coarse) = (joint.number(), registers.get(54 + joint.index()));
        let is_measured = registers.get(MEASURED) & joint.bit() != 0;
        let fine = fine_position(registers, joint);
        let agrees = match fine {
            // Each view is rounded by itself, so they differ by up to half a degree.
            Some(fine) => is_measured && fine <= 18_000 && fine.abs_diff(u16::from(coarse) * 100) <= 50,
            None => !is_measured && coarse == 0,
        };
        ensure(agrees, || {
            format!("joint {number} is at {coarse} and {fine:?} hundredths, measured: {is_measured}")
        })?;
    }
    Ok(())
}

/// Checks that the fine position of a joint at rest is its true position, `counts` (D21).
pub(crate) fn check_position(joint: Joint, counts: u16, offset: i8, registers: &RegisterFile) -> Check {
    let angle = angle_from_counts(joint, counts, offset).0.clamp(0, 180_000_000);
    let fine = fine_position(registers, joint);
    let is_right = fine.is_some_and(|fine| (i32::from(fine) * 10_000).abs_diff(angle) <= 5_000);
    ensure(is_right, || {
        format!("joint {} is at {angle} microdegrees, not {fine:?} hundredths", joint.number())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_byte_registers_are_written_whole() {
        let of = |first: u8, values: &[u8]| (first..).zip(values.iter().copied()).collect::<Vec<_>>();
        assert_eq!(word_offence(&of(127, &[0, 1]), 128), Some((refusal::HALF_A_WORD, 128)));
        assert_eq!(word_offence(&of(129, &[0]), 129), Some((refusal::HALF_A_WORD, 128)));
        assert_eq!(word_offence(&of(128, &[0x50, 0x46]), 129), None, "18000");
        assert_eq!(word_offence(&of(140, &[0x51, 0x46]), 140), Some((refusal::OUT_OF_RANGE, 140)));
        let period = |value: u16| word_offence(&of(184, &value.to_le_bytes()), 185);
        assert_eq!([0, 5, 1_000].map(period), [None; 3]);
        assert_eq!([4, 1_001].map(period), [Some((refusal::OUT_OF_RANGE, PERIOD)); 2]);
        assert_eq!(word_offence(&of(142, &[1]), 142), None, "not writable");
        let written: Vec<_> = fine_targets(&of(129, &[9, 1, 2])).collect();
        assert_eq!(written.iter().map(|(_, value)| *value).collect::<Vec<_>>(), [0x201]);
    }
}
