//! The streams of reports that a client can have.

use protocol_core::registers::map::{FINE_POSITION, LOAD, PRESENT_POSITION, report_content};
use protocol_core::registers::map21::{PRESENT_ANGLE, PRESENT_LOAD};

/// A stream of reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The present positions of map 2.2.
    Positions,
    /// The present positions in hundredths of a degree ([D26](protocol_core::decisions#d26)).
    FinePositions,
    /// The present positions in hundredths of a degree, velocities and loads ([D26](protocol_core::decisions#d26)).
    FineState,
    /// The present angles of map 2.1.
    Angles,
    /// The present loads of map 2.1.
    Loads,
}

/// Number of streams.
pub(crate) const STREAMS: usize = 5;

impl Stream {
    /// All streams.
    pub(crate) const ALL: [Self; STREAMS] =
        [Self::Positions, Self::FinePositions, Self::FineState, Self::Angles, Self::Loads];

    /// The stream of register 53 for a value of register 189 ([D26](protocol_core::decisions#d26)).
    pub(crate) const fn of_content(content: u8) -> Self {
        match content {
            report_content::FINE_POSITIONS => Self::FinePositions,
            report_content::FINE_STATE => Self::FineState,
            _ => Self::Positions,
        }
    }

    /// The address of the first register in a report, and how many there are.
    #[must_use]
    pub const fn registers(self) -> (u8, u8) {
        let row = match self {
            Self::Positions => PRESENT_POSITION,
            Self::FinePositions => FINE_POSITION,
            Self::FineState => {
                return (FINE_POSITION.address, LOAD.address + LOAD.count - FINE_POSITION.address);
            }
            Self::Angles => PRESENT_ANGLE,
            Self::Loads => PRESENT_LOAD,
        };
        (row.address, row.count)
    }

    /// Its place in [`Stream::ALL`].
    pub(crate) const fn index(self) -> usize {
        self as usize
    }
}
