//! The chip's two journal sectors as a simulated NOR flash.
//!
//! It behaves like the real flash where that matters to the journal: programming only clears bits, erasing sets all bits of a
//! sector, and a restart changes nothing. The bytes are in memory, or in other [`Cells`]. This module does not interpret
//! them.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt::Debug;
use core::iter;

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
    /// The cells cannot be read.
    fn read(&self, offset: usize, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind>;

    /// Replaces the bytes from `offset` on.
    ///
    /// # Errors
    /// The cells cannot be written.
    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), NorFlashErrorKind>;
}

/// Cells in memory. A copy has cells of its own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Memory {
    /// All cells beyond the end of this vector are erased.
    bytes: Vec<u8>,
}

impl Memory {
    /// Cells with this content. The cells beyond its end are erased.
    #[must_use]
    pub fn holding(bytes: Vec<u8>) -> Self {
        let mut memory = Self { bytes };
        memory.drop_erased_end();
        memory
    }

    fn drop_erased_end(&mut self) {
        let used = self.bytes.iter().rposition(|&byte| byte != ERASED).map_or(0, |last| last + 1);
        self.bytes.truncate(used);
    }

    /// The cells up to the last one that is not erased.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

impl Cells for Memory {
    fn read(&self, offset: usize, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let stored = self.bytes.iter().skip(offset).copied().chain(iter::repeat(ERASED));
        bytes.iter_mut().zip(stored).for_each(|(byte, stored)| *byte = stored);
        Ok(())
    }

    fn write(&mut self, offset: usize, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let end = offset + bytes.len();
        self.bytes.resize(self.bytes.len().max(end), ERASED);
        let target = self.bytes.get_mut(offset..end).ok_or(NorFlashErrorKind::OutOfBounds)?;
        target.copy_from_slice(bytes);
        self.drop_erased_end();
        Ok(())
    }
}

/// The two journal sectors, with the rules of NOR flash, on cells of the type `C`.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Flash<C = Memory>(C);

impl Flash {
    /// Erased sectors in memory.
    #[must_use]
    pub fn in_memory() -> Self {
        Self::on(Memory::default())
    }
}

impl<C: Cells> Flash<C> {
    /// The sectors on these cells, with the bytes that the cells hold.
    #[must_use]
    pub const fn on(cells: C) -> Self {
        Self(cells)
    }

    /// The cells themselves, for example to copy a settings image.
    pub const fn cells_mut(&mut self) -> &mut C {
        &mut self.0
    }
}

impl<C> ErrorType for Flash<C> {
    type Error = NorFlashErrorKind;
}

impl<C: Cells> ReadNorFlash for Flash<C> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        self.0.read(index(offset)?, bytes)
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl<C: Cells> NorFlash for Flash<C> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let (start, end) = (index(from)?, index(to)?);
        self.0.write(start, &vec![ERASED; end - start])
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let start = index(offset)?;
        let mut programmed = vec![0; bytes.len()];
        self.0.read(start, &mut programmed)?;
        // Programming clears bits and never sets one.
        programmed.iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        self.0.write(start, &programmed)
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
    fn a_copy_has_cells_of_its_own() {
        let mut flash = Flash::in_memory();
        let copy = flash.clone();
        flash.write(0, &[0; 4]).unwrap();
        assert!(!is_blank(flash) && is_blank(copy));
    }
}
