//! The two journal sectors of the flash (RM0090, section 3.6). Knows nothing of what is stored there.
//!
//! The core stands still while a word is programmed (16 microseconds) or a sector erased (up to 0.8 s),
//! because it fetches its instructions from the same bank. Words are programmed one by one, so interrupts get
//! their turn in between; erasing is for start only, before the servos are looked after.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use stm32f4::stm32f405 as pac;

use crate::clock::micros;
use crate::fault::Watchdog;

/// Bytes of a sector: `memory.x` gives the journal two of those that are this small.
const SECTOR: usize = 16 * 1024;
/// Bytes of the journal.
const JOURNAL: usize = 2 * SECTOR;
/// Sectors are numbered from the start of the flash, which lies on a multiple of its size.
const FLASH: usize = 1024 * 1024;
/// Bytes programmed at once: at 2.7 V and more a word (RM0090, table 13), and below 2.9 V nothing is.
const WORD: usize = 4;
/// Ten times what a word may take, in microseconds (datasheet DS8626, table 42).
const WORD_LIMIT_MICROS: u32 = 1_000;
/// Twice what a sector may take.
const SECTOR_LIMIT_MICROS: u32 = 1_200_000;

unsafe extern "C" {
    /// The journal: `memory.x` puts it there.
    static mut _journal_start: [u32; JOURNAL / WORD];
}

/// Why the flash did not do what it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub(crate) enum Error {
    /// The range is not in the journal, or not on its grid.
    Range(NorFlashErrorKind),
    /// The chip is not set to reset below 2.7 V: see `docs/bring-up.md` for the option byte.
    BrownOutLevel,
    /// The supply is below 2.9 V now.
    Supply,
    /// The chip refused: bits of FLASH_SR.
    Refused(u32),
    /// The chip did not come back in time.
    Timeout,
    /// Nothing was refused, and yet the flash does not hold what was programmed.
    Unchanged,
}

impl NorFlashError for Error {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Range(kind) => *kind,
            _ => NorFlashErrorKind::Other,
        }
    }
}

impl From<NorFlashErrorKind> for Error {
    fn from(kind: NorFlashErrorKind) -> Self {
        Self::Range(kind)
    }
}

/// The journal sectors.
pub(crate) struct Flash<'a> {
    registers: pac::FLASH,
    power: pac::PWR,
    watchdog: &'a Watchdog,
}

impl<'a> Flash<'a> {
    /// The journal sectors, and a supervisor of the supply with its threshold at 2.9 V.
    pub(crate) fn new(registers: pac::FLASH, power: pac::PWR, watchdog: &'a Watchdog) -> Self {
        power.cr().modify(|_, w| w.pls().set(7).pvde().enabled());
        Self { registers, power, watchdog }
    }

    fn check_supply(&self) -> Result<(), Error> {
        // 0 is level 3, the highest: reset below 2.7 V.
        if self.registers.optcr().read().bor_lev().bits() != 0 {
            return Err(Error::BrownOutLevel);
        }
        if self.power.csr().read().pvdo().bit_is_set() {
            return Err(Error::Supply);
        }
        Ok(())
    }

    /// Runs an operation between unlocking and locking.
    fn unlocked(&mut self, operation: impl FnOnce(&mut Self) -> Result<(), Error>) -> Result<(), Error> {
        if self.registers.cr().read().lock().bit_is_set() {
            self.registers.keyr().write(|w| w.key().set(0x4567_0123));
            self.registers.keyr().write(|w| w.key().set(0xCDEF_89AB));
        }
        let done = operation(self);
        self.registers.cr().write(|w| w.lock().locked());
        if let Err(error) = done {
            defmt::warn!("flash: {}", error);
        }
        done
    }

    fn erase_sector(&mut self, sector: u8) -> Result<(), Error> {
        self.check_supply()?;
        self.watchdog.feed();
        self.clear_errors();
        self.registers.cr().write(|w| {
            // SAFETY: the number of a journal sector; the erase reaches neither code nor vectors.
            unsafe { w.snb().bits(sector) };
            w.psize().psize32().ser().sector_erase()
        });
        self.registers.cr().modify(|_, w| w.strt().start());
        let done = self.wait(SECTOR_LIMIT_MICROS);
        self.flush_caches();
        self.watchdog.feed();
        done
    }

    fn program(&mut self, cell: *mut u32, word: u32) -> Result<(), Error> {
        self.check_supply()?;
        self.clear_errors();
        self.registers.cr().write(|w| w.psize().psize32().pg().program());
        // SAFETY: a word of the journal, aligned, as `cell` made it. No reference to it exists anywhere; with
        // PG set the write programs it.
        unsafe { cell.write_volatile(word) };
        let done = self.wait(WORD_LIMIT_MICROS);
        self.registers.cr().modify(|_, w| w.pg().clear_bit());
        done?;
        // SAFETY: as above.
        if unsafe { cell.read_volatile() } == word { Ok(()) } else { Err(Error::Unchanged) }
    }

    /// Waits for the end of an operation, and says whether it was refused.
    fn wait(&self, limit_micros: u32) -> Result<(), Error> {
        let start = micros();
        while self.registers.sr().read().bsy().bit_is_set() {
            if micros().wrapping_sub(start) > limit_micros {
                return Err(Error::Timeout);
            }
        }
        match self.registers.sr().read().bits() & ERRORS {
            0 => Ok(()),
            errors => Err(Error::Refused(errors)),
        }
    }

    /// Error bits are cleared by writing ones.
    fn clear_errors(&self) {
        // SAFETY: only flags that a one clears.
        self.registers.sr().write(|w| unsafe { w.bits(ERRORS | END_OF_OPERATION) });
    }

    /// The caches still hold what the sector held before. They can be flushed only while they are off
    /// (RM0090, section 3.5.2).
    fn flush_caches(&self) {
        let acr = self.registers.acr();
        acr.modify(|_, w| w.icen().disabled().dcen().disabled());
        acr.modify(|_, w| w.icrst().set_bit().dcrst().set_bit());
        acr.modify(|_, w| w.icrst().clear_bit().dcrst().clear_bit());
        acr.modify(|_, w| w.icen().enabled().dcen().enabled());
    }
}

/// OPERR, WRPERR, PGAERR, PGPERR, PGSERR of FLASH_SR.
const ERRORS: u32 = 0b1111_0010;
const END_OF_OPERATION: u32 = 1;

/// The word at `offset`, which is a multiple of 4 within the journal.
fn cell(offset: usize) -> *mut u32 {
    (&raw mut _journal_start).cast::<u32>().wrapping_byte_add(offset)
}

/// The number of the sector at `offset`.
fn sector_number(offset: usize) -> u8 {
    let [number, ..] = (cell(offset).addr() % FLASH / SECTOR).to_le_bytes();
    number
}

/// Offsets from `from` to `to`, `step` by `step`.
fn offsets(from: u32, to: usize, step: usize) -> impl Iterator<Item = usize> {
    (from as usize..to).step_by(step)
}

impl ErrorType for Flash<'_> {
    type Error = Error;
}

impl ReadNorFlash for Flash<'_> {
    const READ_SIZE: usize = WORD;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        check_read(self, offset, bytes.len())?;
        let (words, _) = bytes.as_chunks_mut::<WORD>();
        for (word, at) in words.iter_mut().zip(offsets(offset, JOURNAL, WORD)) {
            // SAFETY: a word of the journal, aligned, as `cell` made it; no reference to it exists.
            *word = unsafe { cell(at).read_volatile() }.to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        JOURNAL
    }
}

impl NorFlash for Flash<'_> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        check_erase(self, from, to)?;
        self.unlocked(|flash| {
            offsets(from, to as usize, SECTOR).try_for_each(|at| flash.erase_sector(sector_number(at)))
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        check_write(self, offset, bytes.len())?;
        let (words, _) = bytes.as_chunks::<WORD>();
        self.unlocked(|flash| {
            let mut cells = words.iter().zip(offsets(offset, JOURNAL, WORD));
            cells.try_for_each(|(word, at)| flash.program(cell(at), u32::from_le_bytes(*word)))
        })
    }
}
