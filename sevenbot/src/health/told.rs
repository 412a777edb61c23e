//! What a firmware tells of its health: the blocks of registers that it has, and the effector.

use protocol_core::registers::Joint;
use protocol_core::registers::map::{EXTENDED_VERSION, PROTECTION_VERSION, STATUS_VERSION, effector};

use host_link::Snapshot;

/// The layout of the blocks that this library knows.
const KNOWN_LAYOUT: u8 = 1;
/// The claw. While the effector is a gripper, an obstacle is what it holds.
pub(super) const CLAW: Option<Joint> = Joint::new(7);
/// The value of register 30 for a gripper.
pub(super) const GRIPPER: u8 = effector::GRIPPER;

/// The blocks that a firmware has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ToldBlocks {
    pub(super) extended: bool,
    pub(super) protection: bool,
    pub(super) status: bool,
}

impl ToldBlocks {
    pub(super) fn of(registers: &Snapshot) -> Self {
        let known = |row| registers.byte(row) == KNOWN_LAYOUT;
        Self {
            extended: known(&EXTENDED_VERSION),
            protection: known(&PROTECTION_VERSION),
            status: known(&STATUS_VERSION),
        }
    }
}
