//! What acts on the arm from outside for a time, or once more later.

use protocol_core::registers::Joint;

/// What is due at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// The wall goes.
    Wall(Joint),
    /// The push is over.
    Push(Joint),
    /// The thing goes.
    Thing,
    /// The supply is back.
    Stop,
    /// The servo has an overload once more.
    Trip(Joint),
}
