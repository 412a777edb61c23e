//! The streams of reports that a client can have.

use protocol_core::registers::Register;
use protocol_core::registers::map::PRESENT_POSITION;
use protocol_core::registers::map21::{PRESENT_ANGLE, PRESENT_LOAD};

/// A stream of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The present positions of map 2.2.
    Positions,
    /// The present angles of map 2.1.
    Angles,
    /// The present loads of map 2.1.
    Loads,
}

/// Number of streams.
pub(crate) const STREAMS: usize = 3;

impl Stream {
    /// All streams.
    pub(crate) const ALL: [Self; STREAMS] = [Self::Positions, Self::Angles, Self::Loads];

    /// The registers in a report.
    #[must_use]
    pub const fn registers(self) -> Register {
        match self {
            Self::Positions => PRESENT_POSITION,
            Self::Angles => PRESENT_ANGLE,
            Self::Loads => PRESENT_LOAD,
        }
    }

    /// Its place in [`Stream::ALL`].
    pub(crate) const fn index(self) -> usize {
        self as usize
    }
}
