//! The streams of reports that a client can have.

use protocol_core::registers::Register;
use protocol_core::registers::map::PRESENT_POSITION;

/// A stream of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The present positions of map 2.2.
    Positions,
}

/// Number of streams.
pub(crate) const STREAMS: usize = 1;

impl Stream {
    /// All streams.
    pub(crate) const ALL: [Self; STREAMS] = [Self::Positions];

    /// The registers in a report.
    #[must_use]
    pub const fn registers(self) -> Register {
        match self {
            Self::Positions => PRESENT_POSITION,
        }
    }

    /// Its place in [`Stream::ALL`].
    pub(crate) const fn index(self) -> usize {
        self as usize
    }
}
