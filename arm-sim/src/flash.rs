//! The chip's two journal sectors as a simulated NOR flash.
//!
//! It behaves like the real one where that matters to the journal: programming only clears bits, erasing sets a whole
//! sector, and a restart changes nothing. The bytes are in memory, or in other [`Cells`]. The content does not matter
//! here.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt::Debug;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Bytes of one sector (STM32F405, sectors 0 to 3).
pub const SECTOR_SIZE: usize = 16 * 1024;
/// Bytes of the two journal sectors, and of a settings image.
pub const SIZE: usize = 2 * SECTOR_SIZE;
/// The value of an erased byte.
pub const ERASED: u8 = 0xFF;

/// Where the [`SIZE`] bytes of the sectors are kept.
pub trait Cells: Debug {
    /// Reads the bytes from `offset` on.
    ///
    /// # Errors
    /// The cells failed.
    fn read(&self, offset: usize, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind>;

    /// Replaces the bytes from `offset` on.
    ///
    /// # Errors
    /// The cells failed.
    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), NorFlashErrorKind>;
}

impl Cells for Vec<u8> {
    fn read(&self, offset: usize, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let source = self.get(offset..offset + bytes.len()).ok_or(NorFlashErrorKind::OutOfBounds)?;
        bytes.copy_from_slice(source);
        Ok(())
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let target = self.get_mut(offset..offset + bytes.len()).ok_or(NorFlashErrorKind::OutOfBounds)?;
        target.copy_from_slice(bytes);
        Ok(())
    }
}

/// The two sectors. Clones share their cells, because the flash outlives the controller that runs between two
/// power-ups.
#[derive(Clone, Debug)]
pub struct Flash(Rc<RefCell<dyn Cells>>);

impl Flash {
    /// Erased sectors in memory.
    #[must_use]
    pub fn in_memory() -> Self {
        Self::on(vec![ERASED; SIZE])
    }

    /// Sectors on these cells.
    #[must_use]
    pub fn on(cells: impl Cells + 'static) -> Self {
        Self(Rc::new(RefCell::new(cells)))
    }
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        self.0.borrow().read(index(offset)?, bytes)
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let (start, end) = (index(from)?, index(to)?);
        self.0.borrow_mut().write(start, &vec![ERASED; end - start])
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let start = index(offset)?;
        let mut cells = self.0.borrow_mut();
        let mut programmed = vec![0; bytes.len()];
        cells.read(start, &mut programmed)?;
        // Programming clears bits and never sets one.
        programmed.iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        cells.write(start, &programmed)
    }
}

fn index(offset: u32) -> Result<usize, NorFlashErrorKind> {
    usize::try_from(offset).map_err(|_| NorFlashErrorKind::OutOfBounds)
}

#[cfg(test)]
mod tests {
    use super::NorFlashErrorKind::{NotAligned, OutOfBounds};
    use super::*;

    fn is_blank(mut flash: Flash) -> bool {
        let mut bytes = [0; SIZE];
        flash.read(0, &mut bytes).unwrap();
        bytes == [ERASED; SIZE]
    }

    #[test]
    fn programming_clears_bits_and_erasing_sets_a_whole_sector() {
        let mut flash = Flash::in_memory();
        let mut bytes = [0; 4];
        flash.write(8, &[0xF0; 4]).unwrap();
        flash.write(8, &[0x3C; 4]).unwrap();
        flash.read(8, &mut bytes).unwrap();
        assert_eq!(bytes, [0x30; 4]);
        assert!(!is_blank(flash.clone()));
        flash.erase(0, 16 * 1024).unwrap();
        assert!(is_blank(flash));
    }

    #[test]
    fn what_the_chip_refuses_is_refused() {
        let mut flash = Flash::in_memory();
        assert_eq!(flash.write(2, &[0; 4]), Err(NotAligned));
        assert_eq!(flash.write(4, &[0; 3]), Err(NotAligned));
        assert_eq!(flash.erase(0, 1024), Err(NotAligned));
        assert_eq!(flash.erase(16 * 1024, 0), Err(OutOfBounds));
        assert_eq!(flash.erase(32 * 1024, 48 * 1024), Err(OutOfBounds));
        assert_eq!(flash.read(32 * 1024 - 1, &mut [0; 2]), Err(OutOfBounds));
        assert!(is_blank(flash));
    }

    #[test]
    fn clones_share_their_cells() {
        let mut flash = Flash::in_memory();
        let clone = flash.clone();
        flash.write(0, &[0; 4]).unwrap();
        assert!(!is_blank(clone));
    }
}
