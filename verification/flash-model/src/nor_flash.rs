//! The traits of `embedded-storage` for [`Flash`].

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash, check_erase, check_read, check_write};

use crate::error::Error;
use crate::flash::Flash;

impl<const SECTOR: usize, const WORD: usize> ErrorType for Flash<SECTOR, WORD> {
    type Error = Error;
}

impl<const SECTOR: usize, const WORD: usize> ReadNorFlash for Flash<SECTOR, WORD> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.check_power()?;
        check_read(self, offset, bytes.len()).map_err(Error::Misused)?;
        let cells = self.bytes().get(offset as usize..).unwrap_or_default();
        bytes.iter_mut().zip(cells).for_each(|(to, from)| *to = *from);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes().len()
    }
}

impl<const SECTOR: usize, const WORD: usize> NorFlash for Flash<SECTOR, WORD> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        check_erase(self, from, to).map_err(Error::Misused)?;
        if self.is_inert() {
            return self.check_power();
        }
        (from as usize / SECTOR..to as usize / SECTOR).try_for_each(|sector| self.erase_sector(sector))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        check_write(self, offset, bytes.len()).map_err(Error::Misused)?;
        if self.is_inert() {
            return self.check_power();
        }
        let addresses = (offset as usize..).step_by(WORD);
        addresses.zip(bytes.chunks(WORD)).try_for_each(|(address, new)| self.program(address, new))
    }
}
