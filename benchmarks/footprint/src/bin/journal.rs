//! The settings journal on a flash with unknown contents and results: open, save, release.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use footprint::opaque;
use protocol_core::journal::Journal;
use protocol_core::registers::Image;

/// A flash with the geometry of the reference chip and unknown contents.
struct AnyFlash;

/// An unknown error of the flash.
#[derive(Debug)]
struct AnyError;

impl NorFlashError for AnyError {
    fn kind(&self) -> NorFlashErrorKind {
        opaque(NorFlashErrorKind::Other)
    }
}

impl ErrorType for AnyFlash {
    type Error = AnyError;
}

impl ReadNorFlash for AnyFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), AnyError> {
        opaque((offset, bytes));
        opaque(Ok(()))
    }

    fn capacity(&self) -> usize {
        2 * Self::ERASE_SIZE
    }
}

impl NorFlash for AnyFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 16 * 1024;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), AnyError> {
        opaque((from, to));
        opaque(Ok(()))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), AnyError> {
        opaque((offset, bytes));
        opaque(Ok(()))
    }
}

#[entry]
fn main() -> ! {
    loop {
        let (mut journal, opened) = Journal::open(opaque(AnyFlash));
        opaque(opened.image());
        opaque(journal.save(&opaque(Image([0; Image::LENGTH]))).is_ok());
        opaque(journal.room());
        opaque(journal.release());
    }
}
