//! The two journal sectors as a NOR flash (RM0090, sections 3.6 and 3.9). This file does not know what is stored there, and
//! accesses the chip only through [`FlashRegisters`].
//!
//! The core stalls while a word is programmed (16 to 100 microseconds) or a sector is erased (up to 0.8 s), because it fetches
//! its instructions from the same bank. Interrupts run between two words. Sectors are erased only at start, before the
//! servos are controlled.
//!
//! Each programmed word is read back, and a difference is an error, which occurs in the emulator: no cell changes there. A write
//! also updates the data cache, so the cache is flushed before the read.
//! Tests: `flash/tests.rs`.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

#[cfg(test)]
mod tests;

/// Bytes of a sector.
pub const SECTOR: usize = 16 * 1024;
/// Bytes of the journal: two sectors.
pub const JOURNAL: usize = 2 * SECTOR;
/// Bytes programmed at once. 32 bits need 2.7 V (RM0090, table 13); [`SUPPLY_LEVEL`] is above that.
pub const WORD: usize = 4;
/// Timeout for programming a word, in microseconds: ten times the maximum of the datasheet.
const WORD_LIMIT_MICROS: u32 = 1_000;
/// Timeout for erasing a sector, in microseconds: 1.5 times the maximum of the datasheet.
const SECTOR_LIMIT_MICROS: u32 = 1_200_000;
/// The level of the supply monitor (PLS of PWR_CR). At level 6 the supply counts as low below 2.85 to 2.99 V and as good
/// again above 2.96 to 3.10 V (DS8626, table of the embedded reset and power control block). The upper threshold of
/// level 7 is 3.07 to 3.21 V: a rail of 3.3 V - 5 % might never reach it.
pub const SUPPLY_LEVEL: u8 = 6;
/// Start-up time of the supply monitor, in microseconds. The datasheet gives no figure, so this is an assumption.
pub const SUPPLY_SETTLING_MICROS: u32 = 100;

/// Bits of FLASH_CR (RM0090, section 3.9).
pub mod control {
    /// PG: a write to a cell programs it.
    pub const PROGRAM: u32 = 1 << 0;
    /// SER: `START` erases a sector.
    pub const SECTOR_ERASE: u32 = 1 << 1;
    /// SNB: position of the sector number, four bits.
    pub const SECTOR_NUMBER: u32 = 3;
    /// PSIZE: 32 bits are programmed at once.
    pub const BY_WORDS: u32 = 0b10 << 8;
    /// STRT: starts an erase.
    pub const START: u32 = 1 << 16;
    /// LOCK: no bit of the register can change until both keys are written. Set after a reset.
    pub const LOCK: u32 = 1 << 31;
}

/// Bits of FLASH_SR (RM0090, section 3.9).
pub mod status {
    /// BSY: an operation is running.
    pub const BUSY: u32 = 1 << 16;
    /// EOP: an operation has ended. Writing a one clears it.
    pub const END_OF_OPERATION: u32 = 1 << 0;
    /// Why an operation was refused: OPERR, WRPERR, PGAERR, PGPERR, PGSERR. Writing ones clears them.
    pub const ERRORS: u32 = 0b1111_0010;
}

/// The keys that unlock FLASH_CR, in this order.
pub const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// The registers and cells of the flash, and the supply monitor, watchdog and clock that its driver needs.
pub trait FlashRegisters {
    /// Reads FLASH_SR.
    fn status(&self) -> u32;
    /// Writes FLASH_SR. Ones clear bits.
    fn clear_status(&mut self, bits: u32);
    /// Reads FLASH_CR.
    fn control(&self) -> u32;
    /// Writes FLASH_CR.
    fn set_control(&mut self, bits: u32);
    /// Writes FLASH_KEYR.
    fn enter_key(&mut self, key: u32);
    /// Reads the cell at `offset` of the journal, a multiple of 4.
    fn load(&self, offset: usize) -> u32;
    /// Writes to the cell at `offset` of the journal, a multiple of 4.
    fn store(&mut self, offset: usize, word: u32);
    /// The number of the sector at `offset` of the journal.
    fn sector_number(&self, offset: usize) -> u8;
    /// Empties the data cache. It may hold the old contents of an erased sector, or a written value that the cell did
    /// not take. The instruction cache needs no flush: no code lies in the journal.
    fn flush_data_cache(&mut self);
    /// True if the chip resets below 2.7 V (brown-out level 3).
    fn resets_when_supply_sags(&self) -> bool;
    /// Switches the supply monitor on at `level`, 0 to 7.
    fn watch_supply(&mut self, level: u8);
    /// True if the supply is below the level of [`Self::watch_supply`] now.
    fn supply_is_low(&self) -> bool;
    /// Feeds the watchdog: before and after the erase of a sector.
    fn feed_watchdog(&mut self);
    /// A microsecond counter that wraps.
    fn micros(&self) -> u32;
}

/// Why an operation of [`Flash`] failed. A read fails only with [`Error::Range`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Error {
    /// The range is outside the journal or not aligned.
    Range(NorFlashErrorKind),
    /// The chip does not reset below 2.7 V. `docs/bring-up.md` names the option byte to set.
    BrownOutLevel,
    /// The supply monitor reports a low supply: see [`SUPPLY_LEVEL`].
    Supply,
    /// The chip refused the operation. Holds the error bits of FLASH_SR.
    Refused(u32),
    /// The operation did not end in time, or an earlier one is still running.
    Timeout,
    /// The chip reported no error, but the cells do not hold the programmed word.
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

/// The driver of the two journal sectors.
#[derive(Debug)]
pub struct Flash<C>(C);

impl<C: FlashRegisters> Flash<C> {
    /// Takes ownership of the flash, starts the supply monitor, and waits until it has started.
    pub fn new(mut chip: C) -> Self {
        chip.watch_supply(SUPPLY_LEVEL);
        let start = chip.micros();
        while chip.micros().wrapping_sub(start) < SUPPLY_SETTLING_MICROS {}
        Self(chip)
    }

    /// Unlocks the flash, runs `operation`, and locks the flash again unless it is busy. Logs an error.
    fn unlocked(&mut self, operation: impl FnOnce(&mut Self) -> Result<(), Error>) -> Result<(), Error> {
        if self.0.control() & control::LOCK != 0 {
            KEYS.into_iter().for_each(|key| self.0.enter_key(key));
        }
        let done = operation(self);
        // A write to FLASH_CR during an operation would stall the core until the operation ends.
        if !self.is_busy() {
            self.0.set_control(control::LOCK);
        }
        #[cfg(target_os = "none")]
        if let Err(error) = done {
            defmt::warn!("flash: {}", error);
        }
        done
    }

    fn erase_sector(&mut self, offset: usize) -> Result<(), Error> {
        self.make_ready()?;
        let sector = u32::from(self.0.sector_number(offset)) << control::SECTOR_NUMBER;
        let erase = control::SECTOR_ERASE | control::BY_WORDS | sector;
        self.0.feed_watchdog();
        self.0.set_control(erase);
        self.0.set_control(erase | control::START);
        let done = self.wait(SECTOR_LIMIT_MICROS);
        self.0.flush_data_cache();
        self.0.feed_watchdog();
        done
    }

    fn program(&mut self, offset: usize, word: u32) -> Result<(), Error> {
        self.make_ready()?;
        self.0.set_control(control::PROGRAM | control::BY_WORDS);
        self.0.store(offset, word);
        self.wait(WORD_LIMIT_MICROS)?;
        self.0.flush_data_cache();
        if self.0.load(offset) == word { Ok(()) } else { Err(Error::Unchanged) }
    }

    /// Checks that no operation is running, then checks the brown-out level and the supply. Clears old status bits.
    fn make_ready(&mut self) -> Result<(), Error> {
        if self.is_busy() {
            return Err(Error::Timeout);
        }
        if !self.0.resets_when_supply_sags() {
            return Err(Error::BrownOutLevel);
        }
        if self.0.supply_is_low() {
            return Err(Error::Supply);
        }
        self.0.clear_status(status::ERRORS | status::END_OF_OPERATION);
        Ok(())
    }

    fn is_busy(&self) -> bool {
        self.0.status() & status::BUSY != 0
    }

    /// Waits for the end of an operation and returns its error, if any.
    fn wait(&self, limit_micros: u32) -> Result<(), Error> {
        let start = self.0.micros();
        while self.is_busy() {
            if self.0.micros().wrapping_sub(start) > limit_micros {
                return Err(Error::Timeout);
            }
        }
        match self.0.status() & status::ERRORS {
            0 => Ok(()),
            errors => Err(Error::Refused(errors)),
        }
    }
}

/// The offsets from `from` up to but not including `to`, in steps of `step`.
fn offsets(from: u32, to: usize, step: usize) -> impl Iterator<Item = usize> {
    (from as usize..to).step_by(step)
}

impl<C> ErrorType for Flash<C> {
    type Error = Error;
}

impl<C: FlashRegisters> ReadNorFlash for Flash<C> {
    const READ_SIZE: usize = WORD;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        check_read(self, offset, bytes.len())?;
        let (words, _) = bytes.as_chunks_mut::<WORD>();
        for (word, at) in words.iter_mut().zip(offsets(offset, JOURNAL, WORD)) {
            *word = self.0.load(at).to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        JOURNAL
    }
}

impl<C: FlashRegisters> NorFlash for Flash<C> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        check_erase(self, from, to)?;
        self.unlocked(|flash| offsets(from, to as usize, SECTOR).try_for_each(|at| flash.erase_sector(at)))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        check_write(self, offset, bytes.len())?;
        let (words, _) = bytes.as_chunks::<WORD>();
        self.unlocked(|flash| {
            let mut cells = words.iter().zip(offsets(offset, JOURNAL, WORD));
            cells.try_for_each(|(word, at)| flash.program(at, u32::from_le_bytes(*word)))
        })
    }
}
