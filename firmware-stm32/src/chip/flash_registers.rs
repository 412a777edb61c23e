//! Access to the registers and cells of the chip's flash and to its supply monitor. `crate::flash` decides what
//! to write and when.

use stm32f4::stm32f405 as pac;

use super::clock;
use super::watchdog::Watchdog;
use crate::flash::{FlashRegisters, JOURNAL, SECTOR, WORD};

/// Bytes of the flash. The address of sector 0, where the flash begins, is a multiple of this.
const FLASH: usize = 1024 * 1024;

unsafe extern "C" {
    /// The journal sectors, from `memory.x`.
    static mut _journal_start: [u32; JOURNAL / WORD];
}

/// The registers of the chip's flash and of its supply monitor, and the watchdog that has to be fed around an erase.
pub struct ChipFlashRegisters<'a> {
    registers: pac::FLASH,
    power: pac::PWR,
    watchdog: &'a Watchdog,
}

impl<'a> ChipFlashRegisters<'a> {
    /// Takes ownership of the registers, and changes none.
    pub const fn new(registers: pac::FLASH, power: pac::PWR, watchdog: &'a Watchdog) -> Self {
        Self { registers, power, watchdog }
    }
}

/// The address of the cell at `offset` of the journal. An offset past the end wraps, so it is always in the journal.
fn cell(offset: usize) -> *mut u32 {
    (&raw mut _journal_start).cast::<u32>().wrapping_add(offset / WORD % (JOURNAL / WORD))
}

impl FlashRegisters for ChipFlashRegisters<'_> {
    fn status(&self) -> u32 {
        self.registers.sr().read().bits()
    }

    fn clear_status(&mut self, bits: u32) {
        // SAFETY: ones only clear flags in this register.
        self.registers.sr().write(|w| unsafe { w.bits(bits) });
    }

    fn control(&self) -> u32 {
        self.registers.cr().read().bits()
    }

    fn set_control(&mut self, bits: u32) {
        // SAFETY: the only caller, `crate::flash::Flash`, never sets the mass erase bit. It takes sector numbers from
        // `sector_number`, which returns sectors of the journal. So no code and no vectors are erased.
        self.registers.cr().write(|w| unsafe { w.bits(bits) });
    }

    fn enter_key(&mut self, key: u32) {
        self.registers.keyr().write(|w| w.key().set(key));
    }

    fn load(&self, offset: usize) -> u32 {
        // SAFETY: `cell` returns an aligned word of the journal, and no reference to it exists.
        unsafe { cell(offset).read_volatile() }
    }

    fn store(&mut self, offset: usize, word: u32) {
        // SAFETY: as above. The word is in flash, so the write changes no variable.
        unsafe { cell(offset).write_volatile(word) };
    }

    fn sector_number(&self, offset: usize) -> u8 {
        let [number, ..] = (cell(offset).addr() % FLASH / SECTOR).to_le_bytes();
        number
    }

    /// The data cache can be reset only while it is disabled (RM0090, FLASH_ACR).
    fn flush_data_cache(&mut self) {
        let acr = self.registers.acr();
        acr.modify(|_, w| w.dcen().disabled());
        acr.modify(|_, w| w.dcrst().set_bit());
        acr.modify(|_, w| w.dcrst().clear_bit());
        acr.modify(|_, w| w.dcen().enabled());
    }

    fn resets_when_supply_sags(&self) -> bool {
        // BOR_LEV 0 is level 3, the highest (RM0090, FLASH_OPTCR).
        self.registers.optcr().read().bor_lev().bits() == 0
    }

    fn watch_supply(&mut self, level: u8) {
        self.power.cr().modify(|_, w| w.pls().set(level & 7).pvde().enabled());
    }

    fn supply_is_low(&self) -> bool {
        self.power.csr().read().pvdo().bit_is_set()
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn micros(&self) -> u32 {
        clock::micros()
    }
}
