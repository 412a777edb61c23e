//! Checks the fine targets and positions that a reply shows against the coarse ones, after any writes (D21).

use protocol_core::registers::map::{
    FINE_POSITION, FINE_TARGET, MEASURED_JOINTS, PRESENT_POSITION, TARGET_POSITION,
};
use protocol_core::registers::{Joint, RegisterFile};

/// The largest fine target and fine position: 180 degrees.
const MAX_HUNDREDTHS: u16 = 18_000;
/// A fine position before the first reading.
const UNKNOWN: u16 = 65_535;

/// Checks the registers after a reply with `count` registers from `address` on. Skips a reply without the extended block,
/// because the arm need not compute the block for it.
pub fn check_reply(address: u8, count: u8, registers: &RegisterFile) {
    let end = u16::from(address) + u16::from(count);
    if address > MEASURED_JOINTS.address || end <= FINE_TARGET.address.into() {
        return;
    }
    for joint in Joint::ALL {
        let [target, position] = [FINE_TARGET, FINE_POSITION].map(|row| registers.word(row.of(joint)));
        assert_same_angle(joint, target, registers.get(TARGET_POSITION.of(joint)));
        let is_measured = registers.get(MEASURED_JOINTS.address) & joint.bit() != 0;
        assert_eq!(position != UNKNOWN, is_measured, "{joint:?}: the position and register 190");
        if is_measured {
            assert_same_angle(joint, position, registers.get(PRESENT_POSITION.of(joint)));
        }
    }
}

/// Checks that both views show the same angle. Each view is rounded by itself, so they differ by up to half a degree.
fn assert_same_angle(joint: Joint, hundredths: u16, degrees: u8) {
    assert!(hundredths <= MAX_HUNDREDTHS, "{joint:?}: {hundredths} hundredths");
    let difference = hundredths.abs_diff(u16::from(degrees) * 100);
    assert!(difference <= 50, "{joint:?}: {hundredths} hundredths and {degrees} degrees");
}
