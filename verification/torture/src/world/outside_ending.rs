//! What acts on the arm from outside for a time.

use protocol_core::registers::Joint;

/// What ends at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    Wall(Joint),
    Push(Joint),
    Thing,
    Stop,
}
