//! Tests of the flash driver against the rules of the chip (RM0090, section 3). The model panics where the manual leaves
//! the result undefined.

use std::cell::{Cell, RefCell};

use flash_model::{Cache, Comparator, Supply};
use protocol_core::journal::{Journal, Opened};
use protocol_core::registers::Image;

use super::*;

/// The journal's sectors are 1 and 2.
const FIRST_SECTOR: usize = 1;
/// Offset of the second one.
const SECOND: u32 = 16 * 1024;
/// Offset behind the journal.
const END: u32 = 2 * SECOND;
const WRITE_PROTECTED: u32 = 1 << 4;

/// The data cache of the chip: 8 lines of 128 bits (RM0090, section 3.5.2).
type DataCache = Cache<16, 8>;
/// The lowest supply at which a word can be programmed (RM0090, table 13).
const LEAST_MILLIVOLTS: u32 = 2_700;

/// A model of the chip as the driver sees it.
struct Model {
    cells: RefCell<flash_model::Flash<SECTOR, WORD>>,
    cache: RefCell<DataCache>,
    control: u32,
    errors: u32,
    keys: Vec<u32>,
    micros: Cell<u32>,
    busy_until: u32,
    /// Time to program a word.
    word_micros: u32,
    /// Time to erase a sector.
    sector_micros: u32,
    brown_out_level_3: bool,
    supply: Supply,
    monitor: RefCell<Option<Comparator>>,
    /// The time from which the monitor is valid.
    monitor_settled: u32,
    /// The model refuses writes.
    protected: bool,
    erased: Vec<usize>,
    fed_at: Vec<u32>,
}

/// Start value of the microsecond counter, close to its wrap.
const START: u32 = u32::MAX - 1_000;

impl Model {
    fn new() -> Self {
        Self::with(flash_model::Flash::holding(&[0; JOURNAL]))
    }

    /// A flash that accepts writes and erases and changes nothing, as in the emulator.
    fn inert() -> Self {
        Self::with(flash_model::Flash::inert(&[0; JOURNAL]))
    }

    fn with(cells: flash_model::Flash<SECTOR, WORD>) -> Self {
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
            supply: Supply::steady(3_300),
            monitor: RefCell::new(None),
            monitor_settled: 0,
            protected: false,
            erased: Vec::new(),
            fed_at: Vec::new(),
        }
    }

    fn supplied(supply: Supply) -> Self {
        Self { supply, ..Self::new() }
    }

    /// The contents of a cell, past the cache.
    fn cell(&self, offset: usize) -> [u8; WORD] {
        *self.cells.borrow().bytes()[offset..].first_chunk().unwrap()
    }

    fn is_busy(&self) -> bool {
        self.micros.get().wrapping_sub(self.busy_until) > u32::MAX / 2
    }

    fn is_locked(&self) -> bool {
        self.control & control::LOCK != 0
    }

    /// The present supply, in millivolts. Its time starts with the model.
    fn millivolts(&self) -> u32 {
        self.supply.at(self.micros.get().wrapping_sub(START))
    }

    fn start(&mut self, micros: u32) {
        assert!(!self.is_busy(), "an operation while another runs");
        assert!(self.millivolts() >= LEAST_MILLIVOLTS, "an operation at {} mV", self.millivolts());
        self.busy_until = self.micros.get().wrapping_add(micros);
    }

    fn erase(&mut self) {
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

impl FlashRegisters for Model {
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
        // Until then it reports a good supply.
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

/// Start-up time of the model's supply monitor.
const MONITOR_SETTLES_MICROS: u32 = 20;

fn blank() -> Flash<Model> {
    let mut flash = Flash::new(Model::new());
    flash.erase(0, END).unwrap();
    flash
}

#[test]
fn programmed_words_are_read_back_and_the_flash_is_locked_again() {
    let mut flash = blank();
    assert!(flash.0.is_locked());
    flash.write(SECOND - 8, b"a journal record").unwrap();
    assert!(flash.0.is_locked());
    let mut read = [0; 24];
    flash.read(SECOND - 12, &mut read).unwrap();
    assert_eq!(&read, b"\xFF\xFF\xFF\xFFa journal record\xFF\xFF\xFF\xFF");
}

#[test]
fn an_erase_changes_only_its_sector() {
    let mut flash = blank();
    flash.write(0, b"left").unwrap();
    flash.write(SECOND, b"gone").unwrap();
    flash.0.erased.clear();
    let mut read = [0; WORD];
    flash.read(SECOND, &mut read).unwrap();
    assert_eq!(&read, b"gone");
    flash.erase(SECOND, END).unwrap();
    flash.read(SECOND, &mut read).unwrap();
    assert_eq!(read, [0xFF; WORD], "the old value comes from the cache");
    assert_eq!(flash.0.erased, [2]);
    assert_eq!(flash.0.cell(0), *b"left");
    assert_eq!(flash.0.cell(SECTOR), [0xFF; WORD]);
}

#[test]
fn the_watchdog_is_fed_between_sectors() {
    let mut flash = Flash::new(Model::new());
    flash.0.sector_micros = 800_000;
    let start = flash.0.micros();
    flash.erase(0, END).unwrap();
    let mut last = 0;
    for at in flash.0.fed_at.iter().map(|at| at.wrapping_sub(start)) {
        assert!(at - last < 1_300_000, "no feed from {last} to {at} us");
        last = at;
    }
    assert!(last >= 1_600_000);
}

#[test]
fn nothing_is_changed_without_brown_out_level_3() {
    let mut flash = blank();
    flash.0.brown_out_level_3 = false;
    assert_eq!(flash.write(0, b"word"), Err(Error::BrownOutLevel));
    assert_eq!(flash.erase(0, END), Err(Error::BrownOutLevel));
    assert_eq!(flash.0.cell(0), [0xFF; WORD]);
    assert_eq!(flash.0.erased, [1, 2], "erased by the setup of the test");
    assert!(flash.0.is_locked());
}

#[test]
fn the_first_operation_already_refuses_a_low_supply() {
    let mut flash = Flash::new(Model::supplied(Supply::steady(2_750)));
    assert_eq!(flash.erase(0, END), Err(Error::Supply));
    assert_eq!(flash.write(0, b"word"), Err(Error::Supply));
    assert!(flash.0.erased.is_empty() && flash.0.is_locked());
}

#[test]
fn a_supply_of_3v3_less_5_percent_is_good() {
    let lowest = 3_300 - 3_300 * 5 / 100;
    let mut flash = Flash::new(Model::supplied(Supply::steady(lowest)));
    assert_eq!(flash.erase(0, END), Ok(()));
}

#[test]
fn a_sag_stops_a_write_before_the_supply_is_too_low_for_a_word() {
    // The erase of both sectors takes 0.5 s. Then the supply falls by 1 mV per 10 us, stays at 2.5 V for 1 ms, and rises.
    let sag = Supply::steady(3_300).then(600_000, 3_300).then(608_000, 2_500);
    let sag = sag.then(609_000, 2_500).then(617_000, 3_300);
    let mut flash = Flash::new(Model::supplied(sag));
    flash.erase(0, END).unwrap();
    while flash.0.millivolts() == 3_300 {
        flash.0.micros();
    }
    let words = [0x55; 4_096];
    assert_eq!(flash.write(0, &words), Err(Error::Supply), "the model panics below 2.7 V");
    let programmed = flash.0.cells.borrow().bytes().iter().take_while(|byte| **byte == 0x55).count();
    assert!(programmed > 0 && programmed < words.len(), "{programmed}");
    assert!(flash.0.cells.borrow().bytes()[programmed..].iter().all(|byte| *byte == 0xFF));
    while flash.0.millivolts() < 3_300 {
        flash.0.micros();
    }
    assert_eq!(flash.write(SECOND, b"word"), Ok(()), "writes work again once the supply is good");
}

#[test]
fn a_cell_that_does_not_take_its_bit_is_found_despite_the_cache() {
    let mut flash = blank();
    flash.0.cells.get_mut().wear_out_bit(8 * 4);
    // The journal reads a slot before it writes it, so the cache holds its line.
    flash.read(0, &mut [0; 16]).unwrap();
    assert_eq!(flash.write(0, b"good"), Ok(()));
    assert_eq!(flash.write(4, &[0; 4]), Err(Error::Unchanged));
}

#[test]
fn a_flash_that_changes_nothing_is_an_error() {
    let mut flash = Flash::new(Model::inert());
    assert_eq!(flash.erase(0, END), Ok(()), "the driver does not check that a sector is blank");
    assert_eq!(flash.write(0, b"word"), Err(Error::Unchanged));
}

#[test]
fn a_refused_write_is_an_error_and_the_next_write_works() {
    let mut flash = blank();
    flash.0.protected = true;
    assert_eq!(flash.write(0, b"word"), Err(Error::Refused(WRITE_PROTECTED)));
    flash.0.protected = false;
    assert_eq!(flash.write(4, b"next"), Ok(()));
}

#[test]
fn an_operation_that_does_not_end_is_a_timeout() {
    let mut flash = blank();
    flash.0.word_micros = u32::MAX / 4;
    assert_eq!(flash.write(0, b"word"), Err(Error::Timeout));
    assert_eq!(flash.write(4, b"next"), Err(Error::Timeout), "still busy");
    flash.0.busy_until = flash.0.micros();
    flash.0.word_micros = 16;
    assert_eq!(flash.write(4, b"next"), Ok(()));
    assert!(flash.0.is_locked());
}

#[test]
fn a_range_outside_the_journal_or_unaligned_is_refused() {
    let mut flash = blank();
    let out = Err(Error::Range(NorFlashErrorKind::OutOfBounds));
    let unaligned = Err(Error::Range(NorFlashErrorKind::NotAligned));
    assert_eq!(flash.write(END, b"word"), out);
    assert_eq!(flash.write(2, b"word"), unaligned);
    assert_eq!(flash.erase(0, SECOND + 4), unaligned);
    assert_eq!(flash.erase(0, 2 * END), out);
    assert_eq!(flash.read(END - 4, &mut [0; 8]), out);
}

#[test]
fn the_journal_finds_its_settings_again() {
    let (mut journal, opened) = Journal::open(Flash::new(Model::new()));
    assert_eq!(opened, Opened::Damaged, "all zeros are neither blank nor a journal");
    journal.save(&Image([7; Image::LENGTH])).unwrap();
    let (_, opened) = Journal::open(journal.release());
    assert_eq!(opened, Opened::Found(Image([7; Image::LENGTH])));
}

#[test]
fn the_journal_reports_a_flash_that_changes_nothing() {
    let (journal, opened) = Journal::open(Flash::new(Model::inert()));
    assert_eq!(opened, Opened::Broken(None));
    assert_eq!(journal.room(), 0);
}
