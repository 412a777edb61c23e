//! The chip's two journal sectors as a simulated NOR flash: in memory, or in an image file.
//!
//! It behaves like the real one where that matters to the journal: programming only clears bits, erasing
//! sets a whole sector, nothing is undone by a restart. Every operation reaches the file before it returns
//! and in the order it was asked for, so a `kill -9` leaves what a power cut would. It knows nothing of
//! what is stored.

use std::cell::RefCell;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::rc::Rc;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use tracing::warn;

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
    /// The image file failed.
    #[error(transparent)]
    File(#[from] io::Error),
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::File(_) => NorFlashErrorKind::Other,
        }
    }
}

/// The two sectors. Clones are handles to the same cells: the flash outlives the firmware that runs from
/// one power-up to the next.
#[derive(Clone, Debug)]
pub struct Flash(Rc<RefCell<Cells>>);

#[derive(Debug)]
enum Cells {
    Memory(Vec<u8>),
    File(File),
}

impl Flash {
    /// Blank sectors that are forgotten with the process.
    #[must_use]
    pub fn in_memory() -> Self {
        Self::from_bytes(vec![ERASED; SIZE])
    }

    /// Sectors in a file, which must be [`SIZE`] bytes long.
    #[must_use]
    pub fn in_file(file: File) -> Self {
        Self(Rc::new(RefCell::new(Cells::File(file))))
    }

    /// What the sectors hold now, in memory: to try something that must not touch the original.
    ///
    /// # Errors
    /// The image file could not be read.
    pub fn copy(&self) -> io::Result<Self> {
        let mut bytes = vec![0; SIZE];
        self.0.borrow().read(0, &mut bytes)?;
        Ok(Self::from_bytes(bytes))
    }

    /// Is every byte erased?
    ///
    /// # Errors
    /// The image file could not be read.
    pub fn is_blank(&self) -> io::Result<bool> {
        let mut bytes = vec![0; SIZE];
        self.0.borrow().read(0, &mut bytes)?;
        Ok(bytes.iter().all(|&byte| byte == ERASED))
    }

    fn from_bytes(bytes: Vec<u8>) -> Self {
        Self(Rc::new(RefCell::new(Cells::Memory(bytes))))
    }
}

impl Cells {
    fn read(&self, offset: usize, bytes: &mut [u8]) -> io::Result<()> {
        match self {
            Self::File(file) => file.read_exact_at(bytes, offset as u64),
            Self::Memory(cells) => {
                let source = cells.get(offset..offset + bytes.len()).ok_or(io::ErrorKind::UnexpectedEof)?;
                bytes.copy_from_slice(source);
                Ok(())
            }
        }
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::File(file) => file
                .write_all_at(bytes, offset as u64)
                .inspect_err(|error| warn!("cannot write to the settings image: {error}")),
            Self::Memory(cells) => {
                let end = offset + bytes.len();
                cells.get_mut(offset..end).ok_or(io::ErrorKind::UnexpectedEof)?.copy_from_slice(bytes);
                Ok(())
            }
        }
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

    fn in_a_file() -> Flash {
        let mut file = tempfile::tempfile().unwrap();
        io::Write::write_all(&mut file, &[ERASED; SIZE]).unwrap();
        Flash::in_file(file)
    }

    #[test]
    fn programming_clears_bits_and_erasing_sets_a_whole_sector() {
        for mut flash in [Flash::in_memory(), in_a_file()] {
            let mut cells = [0; 4];
            flash.write(8, &[0xF0; 4]).unwrap();
            flash.write(8, &[0x3C; 4]).unwrap();
            flash.read(8, &mut cells).unwrap();
            assert_eq!(cells, [0x30; 4]);
            assert!(!flash.is_blank().unwrap());
            flash.erase(0, 16 * 1024).unwrap();
            assert!(flash.is_blank().unwrap());
        }
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
