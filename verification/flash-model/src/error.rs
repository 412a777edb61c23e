//! The error of a flash operation.

use embedded_storage::nor_flash::{NorFlashError, NorFlashErrorKind};

/// Why a flash operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The power was cut during this operation or before it.
    PowerLost,
    /// The range violates the bounds or the alignment that `embedded-storage` requires.
    Misused(NorFlashErrorKind),
    /// Erases are forbidden: see [`Flash::forbid_erase`](crate::Flash::forbid_erase).
    EraseForbidden,
    /// The word has another value, and was not erased since. The value may come from an interrupted program operation, or from
    /// the creation of the flash.
    ProgrammedTwice,
    /// An erase of the sector was cut half way, and no complete erase followed.
    HalfErased,
}

impl NorFlashError for Error {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Misused(kind) => *kind,
            _ => NorFlashErrorKind::Other,
        }
    }
}
