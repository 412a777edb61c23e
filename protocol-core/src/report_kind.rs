//! What a report holds ([D14](crate::decisions#d14), [D26](crate::decisions#d26), [M4](crate::decisions#m4)).

use crate::registers::map::{FINE_POSITION, LOAD, PRESENT_POSITION, report_content};
use crate::registers::map21::{Map, PRESENT_ANGLE, PRESENT_LOAD};

/// What a report holds. The reports of one kind form one stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ReportKind {
    /// The present positions of map 2.2.
    Positions,
    /// The present positions in hundredths of a degree.
    FinePositions,
    /// The present positions in hundredths of a degree, velocities and loads.
    FineState,
    /// The present angles of map 2.1.
    Angles,
    /// The present loads of map 2.1.
    Loads,
}

impl ReportKind {
    /// All kinds, in the order of [`ReportKind::index`].
    pub const ALL: [Self; 5] =
        [Self::Positions, Self::FinePositions, Self::FineState, Self::Angles, Self::Loads];

    /// The index of this kind in [`ReportKind::ALL`], 0 to 4.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The kind for a value of register 189 ([D26](crate::decisions#d26)). Values above 2 count as 0.
    #[must_use]
    pub const fn of_content(content: u8) -> Self {
        match content {
            report_content::FINE_POSITIONS => Self::FinePositions,
            report_content::FINE_STATE => Self::FineState,
            _ => Self::Positions,
        }
    }

    /// The address of the first register in the report, and the number of registers.
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

    /// The map that defines the frame of the report.
    #[must_use]
    pub const fn map(self) -> Map {
        match self {
            Self::Positions | Self::FinePositions | Self::FineState => Map::V22,
            Self::Angles | Self::Loads => Map::V21,
        }
    }

    /// Does the report hold registers of the extended block?
    #[must_use]
    pub const fn is_extended(self) -> bool {
        matches!(self, Self::FinePositions | Self::FineState)
    }
}
