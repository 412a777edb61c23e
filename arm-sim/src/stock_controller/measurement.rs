//! Which servos are read before a frame is sent.

use alloc::collections::VecDeque;

use protocol_core::registers::map21::{PRESENT_ANGLE, PRESENT_LOAD};
use protocol_core::registers::{Joint, Register};

/// Servos that are read one after the other, before a frame is sent.
#[derive(Clone, Debug)]
pub(super) struct Measurement {
    /// The frame is a report, which the host did not request.
    pub(super) is_report: bool,
    pub(super) first: u8,
    pub(super) count: u8,
    /// The joints that were not read yet.
    pub(super) joints: VecDeque<Joint>,
    /// The joint whose answer is outstanding.
    pub(super) asked: Option<Joint>,
}

impl Measurement {
    /// The reply to a read. Registers 83 to 89 and 91 to 97 are measured first.
    pub(super) fn reply(first: u8, count: u8) -> Self {
        let is_read = |address: u8| address.checked_sub(first).is_some_and(|index| index < count);
        let is_measured =
            |joint: &Joint| [PRESENT_ANGLE, PRESENT_LOAD].iter().any(|row| is_read(row.of(*joint)));
        let joints = Joint::ALL.into_iter().filter(is_measured).collect();
        Self { is_report: false, first, count, joints, asked: None }
    }

    /// A feedback frame with the registers of a row.
    pub(super) fn feedback(row: &Register) -> Self {
        let joints = Joint::ALL.into_iter().collect();
        Self { is_report: true, first: row.address, count: row.count, joints, asked: None }
    }
}
