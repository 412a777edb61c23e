//! The two journal sectors as a NOR flash (RM0090, sections 3.6 and 3.9). Knows nothing of what is stored
//! there, and sees the chip through its registers only.
//!
//! The core stands still while a word is programmed (16 microseconds) or a sector erased (up to 0.8 s),
//! because it fetches its instructions from the same bank. Words are programmed one by one, with interrupts
//! open, so these get their turn in between; erasing is for start only, before the servos are looked after.
//! Where the cells do not take what they are given (the emulator has none that do), that is an error.
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
/// Bytes programmed at once: at 2.7 V and more a word (RM0090, table 13), and below 2.9 V nothing is.
pub const WORD: usize = 4;
/// Ten times what a word may take, in microseconds.
const WORD_LIMIT_MICROS: u32 = 1_000;
/// Half as much again as a sector may take.
const SECTOR_LIMIT_MICROS: u32 = 1_200_000;

/// Bits of FLASH_CR (RM0090, section 3.9.5).
pub mod control {
    /// A write to a cell programs it.
    pub const PROGRAM: u32 = 1 << 0;
    /// `START` erases a sector.
    pub const SECTOR_ERASE: u32 = 1 << 1;
    /// Where the number of that sector stands, four bits.
    pub const SECTOR_NUMBER: u32 = 3;
    /// Cells are programmed by words of 32 bits.
    pub const BY_WORDS: u32 = 0b10 << 8;
    /// Starts an erase.
    pub const START: u32 = 1 << 16;
    /// No bit can be changed before both keys have come. Reads 1 after a reset.
    pub const LOCK: u32 = 1 << 31;
}

/// Bits of FLASH_SR (RM0090, section 3.9.4).
pub mod status {
    /// An operation is running.
    pub const BUSY: u32 = 1 << 16;
    /// An operation has ended; a one clears it.
    pub const END_OF_OPERATION: u32 = 1 << 0;
    /// Why one was refused: OPERR, WRPERR, PGAERR, PGPERR, PGSERR; ones clear them.
    pub const ERRORS: u32 = 0b1111_0010;
}

/// What unlocks FLASH_CR, in this order.
pub const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// The chip, as far as its flash is concerned.
pub trait Chip {
    /// Reads FLASH_SR.
    fn status(&self) -> u32;
    /// Writes FLASH_SR, where ones clear.
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
    /// Empties the caches, which still hold what an erased sector held before.
    fn flush_caches(&mut self);
    /// Is the chip set to reset itself below 2.7 V (brown-out level 3)?
    fn resets_when_supply_sags(&self) -> bool;
    /// Is the supply below 2.9 V now?
    fn supply_is_low(&self) -> bool;
    /// Feeds the watchdog.
    fn feed_watchdog(&mut self);
    /// A count of microseconds that wraps.
    fn micros(&self) -> u32;
}

/// Why the flash did not do what it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Error {
    /// The range is not in the journal, or not on its grid.
    Range(NorFlashErrorKind),
    /// The chip is not set to reset itself below 2.7 V: `docs/bring-up.md` has the option byte.
    BrownOutLevel,
    /// The supply is below 2.9 V.
    Supply,
    /// The chip refused: the error bits of FLASH_SR.
    Refused(u32),
    /// The chip did not come back in time.
    Timeout,
    /// Nothing was refused, and yet the cells do not hold what was programmed.
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
#[derive(Debug)]
pub struct Flash<C>(pub C);

impl<C: Chip> Flash<C> {
    /// Runs an operation between unlocking and locking.
    fn unlocked(&mut self, operation: impl FnOnce(&mut Self) -> Result<(), Error>) -> Result<(), Error> {
        if self.0.control() & control::LOCK != 0 {
            KEYS.into_iter().for_each(|key| self.0.enter_key(key));
        }
        let done = operation(self);
        // A write to the register of a chip that is still busy would stop the core until it is not.
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
        self.0.flush_caches();
        self.0.feed_watchdog();
        done
    }

    fn program(&mut self, offset: usize, word: u32) -> Result<(), Error> {
        self.make_ready()?;
        self.0.set_control(control::PROGRAM | control::BY_WORDS);
        self.0.store(offset, word);
        self.wait(WORD_LIMIT_MICROS)?;
        if self.0.load(offset) == word { Ok(()) } else { Err(Error::Unchanged) }
    }

    /// Checks chip and supply, and clears what an earlier operation left.
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

    /// Waits for the end of an operation, and says whether it was refused.
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

/// Offsets from `from` up to `to`, `step` by `step`.
fn offsets(from: u32, to: usize, step: usize) -> impl Iterator<Item = usize> {
    (from as usize..to).step_by(step)
}

impl<C> ErrorType for Flash<C> {
    type Error = Error;
}

impl<C: Chip> ReadNorFlash for Flash<C> {
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

impl<C: Chip> NorFlash for Flash<C> {
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
