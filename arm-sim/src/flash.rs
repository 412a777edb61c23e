//! The chip's two journal sectors as a simulated NOR flash.
//!
//! It behaves like the real one where that matters to the journal: programming only clears bits, erasing sets a whole
//! sector, and a restart changes nothing. The bytes are in memory, or wherever other [`Cells`] keep them. This file
//! knows nothing about the stored data.

use std::cell::RefCell;
use std::fmt::Debug;
use std::io;
use std::rc::Rc;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Bytes of one sector (STM32F405, sectors 0 to 3).
pub const SECTOR_SIZE: usize = 16 * 1024;
/// Bytes of the two journal sectors, and so of an image.
pub const SIZE: usize = 2 * SECTOR_SIZE;
/// What an erased byte reads.
pub const ERASED: u8 = 0xFF;

/// Why a flash operation failed.
#[derive(Debug, thiserror::Error)]
pub enum FlashError {
    /// The range is not inside the two sectors.
    #[error("outside the two journal sectors")]
    OutOfBounds,
    /// The range does not fall on words, or on sectors for an erase.
    #[error("not aligned to a word or sector")]
    NotAligned,
    /// The cells failed.
    #[error(transparent)]
    Cells(#[from] io::Error),
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::Cells(_) => NorFlashErrorKind::Other,
        }
    }
}

/// What keeps the [`SIZE`] bytes of the sectors.
pub trait Cells: Debug {
    /// Reads the bytes from `offset` on. The range is inside the sectors.
    ///
    /// # Errors
    /// The cells failed.
    fn read(&self, offset: usize, bytes: &mut [u8]) -> io::Result<()>;

    /// Replaces the bytes from `offset` on. The range is inside the sectors.
    ///
    /// # Errors
    /// The cells failed.
    fn write(&mut self, offset: usize, bytes: &[u8]) -> io::Result<()>;
}

impl Cells for Vec<u8> {
    fn read(&self, offset: usize, bytes: &mut [u8]) -> io::Result<()> {
        let end = offset + bytes.len();
        bytes.copy_from_slice(self.get(offset..end).ok_or(io::ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> io::Result<()> {
        let end = offset + bytes.len();
        self.get_mut(offset..end).ok_or(io::ErrorKind::UnexpectedEof)?.copy_from_slice(bytes);
        Ok(())
    }
}

/// The two sectors. Clones are handles to the same cells: the flash outlives the firmware that runs from
/// one power-up to the next.
#[derive(Clone, Debug)]
pub struct Flash(Rc<RefCell<dyn Cells>>);

impl Flash {
    /// Blank sectors that are forgotten with the process.
    #[must_use]
    pub fn in_memory() -> Self {
        Self::on(vec![ERASED; SIZE])
    }

    /// Sectors whose bytes these cells keep.
    #[must_use]
    pub fn on(cells: impl Cells + 'static) -> Self {
        Self(Rc::new(RefCell::new(cells)))
    }

    /// What the sectors hold now, in memory: to try something that must not touch the original.
    ///
    /// # Errors
    /// The cells could not be read.
    pub fn copy(&self) -> io::Result<Self> {
        let mut bytes = vec![0; SIZE];
        self.0.borrow().read(0, &mut bytes)?;
        Ok(Self::on(bytes))
    }

    /// Is every byte erased?
    ///
    /// # Errors
    /// The cells could not be read.
    pub fn is_blank(&self) -> io::Result<bool> {
        let mut bytes = vec![0; SIZE];
        self.0.borrow().read(0, &mut bytes)?;
        Ok(bytes.iter().all(|&byte| byte == ERASED))
    }
}

/// The place of `length` bytes at `offset`, if they are inside the sectors and both ends are multiples of
/// `unit`.
fn place(offset: u32, length: usize, unit: usize) -> Result<usize, FlashError> {
    let offset = usize::try_from(offset).map_err(|_| FlashError::OutOfBounds)?;
    if !offset.is_multiple_of(unit) || !length.is_multiple_of(unit) {
        return Err(FlashError::NotAligned);
    }
    let inside = offset.checked_add(length).is_some_and(|end| end <= SIZE);
    if inside { Ok(offset) } else { Err(FlashError::OutOfBounds) }
}

impl ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let offset = place(offset, bytes.len(), Self::READ_SIZE)?;
        Ok(self.0.borrow().read(offset, bytes)?)
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let length = to.checked_sub(from).ok_or(FlashError::OutOfBounds)?;
        let length = usize::try_from(length).map_err(|_| FlashError::OutOfBounds)?;
        let offset = place(from, length, Self::ERASE_SIZE)?;
        Ok(self.0.borrow_mut().write(offset, &vec![ERASED; length])?)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let offset = place(offset, bytes.len(), Self::WRITE_SIZE)?;
        let mut cells = self.0.borrow_mut();
        let mut programmed = vec![0; bytes.len()];
        cells.read(offset, &mut programmed)?;
        // A program pulse clears bits, it never sets one.
        programmed.iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        Ok(cells.write(offset, &programmed)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programming_clears_bits_and_erasing_sets_a_whole_sector() {
        let mut flash = Flash::in_memory();
        let mut cells = [0; 4];
        flash.write(8, &[0xF0; 4]).unwrap();
        flash.write(8, &[0x3C; 4]).unwrap();
        flash.read(8, &mut cells).unwrap();
        assert_eq!(cells, [0x30; 4]);
        assert!(!flash.is_blank().unwrap());
        flash.erase(0, 16 * 1024).unwrap();
        assert!(flash.is_blank().unwrap());
    }

    #[test]
    fn what_the_chip_would_refuse_is_refused() {
        let mut flash = Flash::in_memory();
        assert!(matches!(flash.write(2, &[0; 4]), Err(FlashError::NotAligned)));
        assert!(matches!(flash.write(4, &[0; 3]), Err(FlashError::NotAligned)));
        assert!(matches!(flash.erase(0, 1024), Err(FlashError::NotAligned)));
        assert!(matches!(flash.erase(16 * 1024, 0), Err(FlashError::OutOfBounds)));
        assert!(matches!(flash.erase(32 * 1024, 48 * 1024), Err(FlashError::OutOfBounds)));
        assert!(matches!(flash.read(32 * 1024 - 1, &mut [0; 2]), Err(FlashError::OutOfBounds)));
        assert!(flash.is_blank().unwrap());
    }

    #[test]
    fn a_clone_is_the_same_flash_and_a_copy_is_not() {
        let mut flash = Flash::in_memory();
        let (clone, copy) = (flash.clone(), flash.copy().unwrap());
        flash.write(0, &[0; 4]).unwrap();
        assert!(!clone.is_blank().unwrap());
        assert!(copy.is_blank().unwrap());
    }
}
