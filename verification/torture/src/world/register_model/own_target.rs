//! The targets that the arm may set itself (D27, D28).

/// The values that a target of the arm may have although the model has another one, beside the measured position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OwnTarget {
    /// The measured position alone.
    Measured,
    /// The joint may be let go: its target follows the measured position, and a point of a stream is not taken (D28). The
    /// target may still be the one before, which is this value in degrees.
    Before(u8),
    /// The joint may have given way to an obstacle: the target is its set-point, between `low` and `high` degrees (D27), or
    /// still the target before.
    GaveWay { low: u8, high: u8, before: u8 },
}

impl OwnTarget {
    /// True if the arm may ignore points of a stream, because the joint may be let go. A joint that gives way may also be let go.
    pub(crate) const fn is_without_streams(self) -> bool {
        !matches!(self, Self::Measured)
    }

    pub(crate) fn may_be(self, degrees: u8) -> bool {
        match self {
            Self::Measured => false,
            Self::Before(before) => degrees == before,
            Self::GaveWay { low, high, before } => (low..=high).contains(&degrees) || degrees == before,
        }
    }
}
