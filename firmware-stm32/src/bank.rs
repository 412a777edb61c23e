//! The registers and cells of the chip's flash, and what guards its supply. When to write what is for
//! `firmware_stm32::flash` to know.

use firmware_stm32::flash::{Chip, JOURNAL, SECTOR, WORD};
use stm32f4::stm32f405 as pac;

use crate::clock;
use crate::fault::Watchdog;

/// Sectors are numbered from the start of the flash, which lies on a multiple of its size.
const FLASH: usize = 1024 * 1024;

unsafe extern "C" {
    /// The journal: `memory.x` puts it there.
    static mut _journal_start: [u32; JOURNAL / WORD];
}

/// The chip's flash.
pub(crate) struct Bank<'a> {
    registers: pac::FLASH,
    power: pac::PWR,
    watchdog: &'a Watchdog,
}

impl<'a> Bank<'a> {
    /// Takes the flash over, and lets the chip watch for a supply below 2.9 V.
    pub(crate) fn new(registers: pac::FLASH, power: pac::PWR, watchdog: &'a Watchdog) -> Self {
        power.cr().modify(|_, w| w.pls().set(7).pvde().enabled());
        Self { registers, power, watchdog }
    }
}

/// The cell at `offset`: of the journal, whatever the offset.
fn cell(offset: usize) -> *mut u32 {
    (&raw mut _journal_start).cast::<u32>().wrapping_add(offset / WORD % (JOURNAL / WORD))
}

impl Chip for Bank<'_> {
    fn status(&self) -> u32 {
        self.registers.sr().read().bits()
    }

    fn clear_status(&mut self, bits: u32) {
        // SAFETY: flags that ones clear, no more.
        self.registers.sr().write(|w| unsafe { w.bits(bits) });
    }

    fn control(&self) -> u32 {
        self.registers.cr().read().bits()
    }

    fn set_control(&mut self, bits: u32) {
        // SAFETY: the one caller erases sectors by the number that `sector_number` gave it, which are the
        // journal's, and never the whole flash: code and vectors stay as they are.
        self.registers.cr().write(|w| unsafe { w.bits(bits) });
    }

    fn enter_key(&mut self, key: u32) {
        self.registers.keyr().write(|w| w.key().set(key));
    }

    fn load(&self, offset: usize) -> u32 {
        // SAFETY: a word of the journal, aligned, as `cell` makes it; no reference to it exists.
        unsafe { cell(offset).read_volatile() }
    }

    fn store(&mut self, offset: usize, word: u32) {
        // SAFETY: as above; it is program memory, so what is written changes nobody's variable.
        unsafe { cell(offset).write_volatile(word) };
    }

    fn sector_number(&self, offset: usize) -> u8 {
        let [number, ..] = (cell(offset).addr() % FLASH / SECTOR).to_le_bytes();
        number
    }

    /// The caches can be reset only while they are off (RM0090, FLASH_ACR).
    fn flush_caches(&mut self) {
        let acr = self.registers.acr();
        acr.modify(|_, w| w.icen().disabled().dcen().disabled());
        acr.modify(|_, w| w.icrst().set_bit().dcrst().set_bit());
        acr.modify(|_, w| w.icrst().clear_bit().dcrst().clear_bit());
        acr.modify(|_, w| w.icen().enabled().dcen().enabled());
    }

    fn resets_when_supply_sags(&self) -> bool {
        // 0 is level 3, the highest (RM0090, FLASH_OPTCR).
        self.registers.optcr().read().bor_lev().bits() == 0
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
