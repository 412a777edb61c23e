//! The flash as `embedded-storage` knows one.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

use crate::Flash;

/// Why the flash did not do as it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The power was cut, during this operation or before.
    PowerLost,
    /// The bounds or the alignment of `embedded-storage`'s contract.
    Misused(NorFlashErrorKind),
    /// An erase while [`Flash::forbid_erase`] was in force.
    EraseForbidden,
    /// This word was programmed or begun before, with another value.
    ProgrammedTwice,
    /// The last erase of this sector was cut.
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

impl<const SECTOR: usize, const WORD: usize> ErrorType for Flash<SECTOR, WORD> {
    type Error = Error;
}

impl<const SECTOR: usize, const WORD: usize> ReadNorFlash for Flash<SECTOR, WORD> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.check_power()?;
        check_read(self, offset, bytes.len()).map_err(Error::Misused)?;
        let cells = self.cells.get(offset as usize..).unwrap_or_default();
        bytes.iter_mut().zip(cells).for_each(|(to, from)| *to = *from);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.cells.len()
    }
}

impl<const SECTOR: usize, const WORD: usize> NorFlash for Flash<SECTOR, WORD> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        check_erase(self, from, to).map_err(Error::Misused)?;
        if self.inert {
            return self.check_power();
        }
        (from as usize / SECTOR..to as usize / SECTOR).try_for_each(|sector| self.erase_sector(sector))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        check_write(self, offset, bytes.len()).map_err(Error::Misused)?;
        if self.inert {
            return self.check_power();
        }
        let addresses = (offset as usize..).step_by(WORD);
        addresses.zip(bytes.chunks(WORD)).try_for_each(|(address, new)| self.program(address, new))
    }
}
