//! Finds the angles of joints, and the limits of the arm, in register values that were read or are to be written.

use protocol_core::registers::map::LIMITS;
use protocol_core::registers::{JOINTS, Joint, Register};

/// The angle of each joint in hundredths of a degree; `None` for a joint whose registers are not among the values.
pub(crate) type JointAngles = [Option<u16>; JOINTS];

/// The value of a fine position that was not measured.
pub(crate) const UNMEASURED: u16 = u16::MAX;
/// Hundredths of a degree in a register of one byte.
pub(crate) const DEGREE: u16 = 100;

/// The angles of a row in the values from `address` on, as far as they are there, in hundredths of a degree.
pub(crate) fn angles_in(row: &Register, address: u8, values: &[u8]) -> JointAngles {
    Joint::ALL.map(|joint| {
        let start = usize::from(row.of(joint).checked_sub(address)?);
        match *values.get(start..start + usize::from(row.range.width()))? {
            [degrees] => Some(DEGREE * u16::from(degrees)),
            [low, high] => Some(u16::from_le_bytes([low, high])),
            _ => None,
        }
    })
}

/// Register 188 in the values from `address` on; no limits if it is not there.
pub(crate) fn limits_in(address: u8, values: &[u8]) -> u8 {
    let limits = LIMITS.address.checked_sub(address).and_then(|at| values.get(usize::from(at)));
    limits.copied().unwrap_or_default()
}
