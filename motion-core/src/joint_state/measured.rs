//! What a reading of a servo meant for its joint.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measured {
    /// The position filter rejected the reading.
    Rejected,
    /// The filter rejected the reading, and the servo counts as silent from now on.
    FellSilent,
    /// The filter accepted the reading. The servo was not silent, and its error bits and its temperature are as before.
    Accepted,
    /// The filter accepted the reading. The servo was silent, its error bits or its temperature changed, the joint was let go, or
    /// the set-point caught up.
    ServoChanged,
    /// The filter accepted the reading, and the joint engaged: its servo needs its goal, then a question about it.
    Engaged,
    /// The joint needs torque, after its goal was sent `goals` times.
    TorqueDue { goals: u8 },
    /// An alarm has freed the joint: its servo needs torque-off, which frees nothing and ends a latched overload
    /// ([D28](protocol_core::decisions#d28)).
    Freed,
    /// The servo of a driven joint has no torque. [`Joints`](crate::joints::Joints) decides what that means
    /// ([D29](protocol_core::decisions#d29)).
    TorqueLost,
    /// The supply was lost: a driven servo has no torque after a long silence of all driven servos
    /// ([D29](protocol_core::decisions#d29)).
    SupplyLost,
    /// The joint has turned past a set-point that an obstacle held back. [`Joints`](crate::joints::Joints) lets the set-point
    /// catch up.
    TurnedPast,
}
