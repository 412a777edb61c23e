//! The end of an influence from outside the arm, or its repetition.

use protocol_core::registers::Joint;

/// An event that is due at a later time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    Wall(Joint),
    Push(Joint),
    Thing,
    /// The supply is back.
    Stop,
    /// Another overload is forced on the servo.
    Trip(Joint),
}
