//! A model of the chip's flash controller, supply monitor and clock. It panics where the manual leaves the result
//! undefined.

use std::cell::{Cell, RefCell};

use flash_model::{Cache, Comparator, FlashSupply};

use super::super::*;
use super::{FIRST_SECTOR, SECOND, WRITE_PROTECTED};

/// The data cache of the chip: 8 lines of 128 bits (RM0090, section 3.5.2).
type DataCache = Cache<16, 8>;
/// The lowest supply at which a word can be programmed (RM0090, table 13).
pub(super) const LEAST_MILLIVOLTS: u32 = 2_700;

/// A model of the chip as the driver sees it.
pub(super) struct ChipModel {
    pub(super) cells: RefCell<flash_model::Flash<SECTOR, WORD>>,
    pub(super) cache: RefCell<DataCache>,
    pub(super) control: u32,
    pub(super) errors: u32,
    pub(super) keys: Vec<u32>,
    pub(super) micros: Cell<u32>,
    pub(super) busy_until: u32,
    /// Time to program a word.
    pub(super) word_micros: u32,
    /// Time to erase a sector.
    pub(super) sector_micros: u32,
    pub(super) brown_out_level_3: bool,
    pub(super) supply: FlashSupply,
    pub(super) monitor: RefCell<Option<Comparator>>,
    /// The time from which the monitor is valid.
    pub(super) monitor_settled: u32,
    /// True if the model refuses writes.
    pub(super) protected: bool,
    pub(super) erased: Vec<usize>,
    pub(super) fed_at: Vec<u32>,
}

/// Start value of the microsecond counter, close to its wrap.
pub(super) const START: u32 = u32::MAX - 1_000;

impl ChipModel {
    pub(super) fn new() -> Self {
        Self::with(flash_model::Flash::holding(&[0; JOURNAL]))
    }

    /// A flash that accepts writes and erases and changes nothing, as in the emulator.
    pub(super) fn inert() -> Self {
        Self::with(flash_model::Flash::inert(&[0; JOURNAL]))
    }

    pub(super) fn with(cells: flash_model::Flash<SECTOR, WORD>) -> Self {
        Self {
            cells: RefCell::new(cells),
            cache: RefCell::new(DataCache::new()),
            control: control::LOCK,
            errors: 0,
            keys: Vec::new(),
            micros: Cell::new(START),
            busy_until: START,
            word_micros: 16,
            sector_micros: 250_000,
            brown_out_level_3: true,
            supply: FlashSupply::steady(3_300),
            monitor: RefCell::new(None),
            monitor_settled: 0,
            protected: false,
            erased: Vec::new(),
            fed_at: Vec::new(),
        }
    }

    pub(super) fn supplied(supply: FlashSupply) -> Self {
        Self { supply, ..Self::new() }
    }

    /// The contents of a cell, read past the cache.
    pub(super) fn cell(&self, offset: usize) -> [u8; WORD] {
        *self.cells.borrow().bytes()[offset..].first_chunk().unwrap()
    }

    pub(super) fn is_busy(&self) -> bool {
        self.micros.get().wrapping_sub(self.busy_until) > u32::MAX / 2
    }

    pub(super) fn is_locked(&self) -> bool {
        self.control & control::LOCK != 0
    }

    /// The present supply, in millivolts. The times of `supply` count from [`START`].
    pub(super) fn millivolts(&self) -> u32 {
        self.supply.at(self.micros.get().wrapping_sub(START))
    }

    pub(super) fn start(&mut self, micros: u32) {
        assert!(!self.is_busy(), "an operation while another runs");
        assert!(self.millivolts() >= LEAST_MILLIVOLTS, "an operation at {} mV", self.millivolts());
        self.busy_until = self.micros.get().wrapping_add(micros);
    }

    pub(super) fn erase(&mut self) {
        let sector = (self.control >> control::SECTOR_NUMBER & 0xF) as usize;
        assert!((FIRST_SECTOR..FIRST_SECTOR + 2).contains(&sector), "sector {sector} is not in the journal");
        assert_ne!(self.control & control::BY_WORDS, 0, "an erase needs PSIZE too");
        assert_eq!(self.control & control::PROGRAM, 0, "erase and program bits both set");
        self.erased.push(sector);
        self.start(self.sector_micros);
        let start = u32::try_from((sector - FIRST_SECTOR) * SECTOR).unwrap();
        self.cells.get_mut().erase(start, start + SECOND).unwrap();
    }
}

impl FlashRegisters for ChipModel {
    fn status(&self) -> u32 {
        self.micros.set(self.micros.get().wrapping_add(1));
        if self.is_busy() { status::BUSY } else { self.errors }
    }

    fn clear_status(&mut self, bits: u32) {
        self.errors &= !bits;
    }

    fn control(&self) -> u32 {
        self.control
    }

    fn set_control(&mut self, bits: u32) {
        assert!(!self.is_locked(), "wrote {bits:#x} to the locked register");
        assert!(!self.is_busy(), "wrote {bits:#x} during an operation, which stops the core");
        self.control = bits;
        self.keys.clear();
        if bits & control::START != 0 {
            assert_ne!(bits & control::SECTOR_ERASE, 0);
            assert!(!self.is_locked(), "LOCK and STRT both set");
            self.erase();
            self.control &= !control::START;
        }
    }

    fn enter_key(&mut self, key: u32) {
        assert!(self.is_locked(), "a key to an open register locks it until the next reset");
        self.keys.push(key);
        assert!(KEYS.starts_with(&self.keys), "a wrong key locks the register until the next reset");
        if self.keys == KEYS {
            self.control = 0;
        }
    }

    fn load(&self, offset: usize) -> u32 {
        let cells = self.cells.borrow();
        u32::from_le_bytes(self.cache.borrow_mut().read(offset, cells.bytes()))
    }

    fn store(&mut self, offset: usize, word: u32) {
        assert!(!self.is_locked());
        assert_eq!(self.control, control::PROGRAM | control::BY_WORDS, "wrote to a cell");
        self.start(self.word_micros);
        self.cache.get_mut().write(offset, &word.to_le_bytes());
        if self.protected {
            self.errors |= WRITE_PROTECTED;
        } else {
            let at = u32::try_from(offset).unwrap();
            self.cells.get_mut().write(at, &word.to_le_bytes()).unwrap();
        }
    }

    fn sector_number(&self, offset: usize) -> u8 {
        u8::try_from(FIRST_SECTOR + offset / SECTOR).unwrap()
    }

    fn flush_data_cache(&mut self) {
        self.cache.get_mut().flush();
    }

    fn resets_when_supply_sags(&self) -> bool {
        self.brown_out_level_3
    }

    /// Worst case of each level: the lowest falling and the highest rising threshold (DS8626, embedded reset and power
    /// control block).
    fn watch_supply(&mut self, level: u8) {
        let comparator = match level {
            6 => Comparator::new(2_850, 3_100),
            7 => Comparator::new(2_950, 3_210),
            _ => panic!("level {level} may be below what a word needs"),
        };
        *self.monitor.get_mut() = Some(comparator);
        self.monitor_settled = self.micros.get().wrapping_add(MONITOR_SETTLES_MICROS);
    }

    fn supply_is_low(&self) -> bool {
        let settled = self.micros.get().wrapping_sub(self.monitor_settled) <= u32::MAX / 2;
        let millivolts = self.millivolts();
        // Before it has settled, the monitor reports a good supply.
        settled && self.monitor.borrow_mut().as_mut().is_some_and(|monitor| monitor.is_low(millivolts))
    }

    fn feed_watchdog(&mut self) {
        self.fed_at.push(self.micros.get());
    }

    fn micros(&self) -> u32 {
        self.micros.set(self.micros.get().wrapping_add(1));
        self.micros.get()
    }
}

/// Start-up time of the model's supply monitor. The driver has to wait longer.
pub(super) const MONITOR_SETTLES_MICROS: u32 = 20;
