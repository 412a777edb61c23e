//! The flash driver against the chip's rules (RM0090, section 3): the model breaks off where the manual
//! says that the result would be undefined, and a chip would carry on somehow.

use std::cell::Cell;

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

/// A chip, seen through its registers.
struct Model {
    cells: Vec<u32>,
    control: u32,
    errors: u32,
    keys: Vec<u32>,
    micros: Cell<u32>,
    busy_until: u32,
    /// What operations take.
    word_micros: u32,
    sector_micros: u32,
    brown_out_level_3: bool,
    low_supply: bool,
    /// Writes and erases are accepted and change nothing, as in the emulator.
    inert: bool,
    /// Writes are refused.
    protected: bool,
    caches_are_stale: bool,
    erased: Vec<usize>,
    fed_at: Vec<u32>,
}

impl Model {
    fn new() -> Self {
        Self {
            cells: vec![0; JOURNAL / WORD],
            control: control::LOCK,
            errors: 0,
            keys: Vec::new(),
            micros: Cell::new(u32::MAX - 1_000),
            busy_until: u32::MAX - 1_000,
            word_micros: 16,
            sector_micros: 250_000,
            brown_out_level_3: true,
            low_supply: false,
            inert: false,
            protected: false,
            caches_are_stale: false,
            erased: Vec::new(),
            fed_at: Vec::new(),
        }
    }

    fn is_busy(&self) -> bool {
        self.micros.get().wrapping_sub(self.busy_until) > u32::MAX / 2
    }

    fn is_locked(&self) -> bool {
        self.control & control::LOCK != 0
    }

    fn start(&mut self, micros: u32) {
        assert!(!self.is_busy(), "an operation while another runs");
        self.busy_until = self.micros.get().wrapping_add(micros);
    }

    fn erase(&mut self) {
        let sector = (self.control >> control::SECTOR_NUMBER & 0xF) as usize;
        assert!((FIRST_SECTOR..FIRST_SECTOR + 2).contains(&sector), "erased sector {sector}: no journal");
        assert_ne!(self.control & control::BY_WORDS, 0, "erases have a parallelism as well");
        assert_eq!(self.control & control::PROGRAM, 0, "erase and program at once");
        self.erased.push(sector);
        self.start(self.sector_micros);
        if !self.inert {
            let start = (sector - FIRST_SECTOR) * SECTOR / WORD;
            self.cells[start..start + SECTOR / WORD].fill(u32::MAX);
        }
        self.caches_are_stale = true;
    }
}

impl Chip for Model {
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
            assert!(!self.is_locked(), "locked what it starts");
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
        assert!(!self.caches_are_stale, "read from stale caches");
        self.cells[offset / WORD]
    }

    fn store(&mut self, offset: usize, word: u32) {
        assert!(!self.is_locked());
        assert_eq!(self.control, control::PROGRAM | control::BY_WORDS, "wrote to a cell");
        self.start(self.word_micros);
        if self.protected {
            self.errors |= WRITE_PROTECTED;
        } else if !self.inert {
            self.cells[offset / WORD] &= word;
        }
    }

    fn sector_number(&self, offset: usize) -> u8 {
        u8::try_from(FIRST_SECTOR + offset / SECTOR).unwrap()
    }

    fn flush_caches(&mut self) {
        self.caches_are_stale = false;
    }

    fn resets_when_supply_sags(&self) -> bool {
        self.brown_out_level_3
    }

    fn supply_is_low(&self) -> bool {
        self.low_supply
    }

    fn feed_watchdog(&mut self) {
        self.fed_at.push(self.micros.get());
    }

    fn micros(&self) -> u32 {
        self.micros.get()
    }
}

fn blank() -> Flash<Model> {
    let mut flash = Flash(Model::new());
    flash.erase(0, END).unwrap();
    flash
}

#[test]
fn what_is_programmed_is_read_and_the_flash_is_locked_again() {
    let mut flash = blank();
    assert!(flash.0.is_locked());
    flash.write(SECOND - 8, b"a journal record").unwrap();
    assert!(flash.0.is_locked());
    let mut read = [0; 24];
    flash.read(SECOND - 12, &mut read).unwrap();
    assert_eq!(&read, b"\xFF\xFF\xFF\xFFa journal record\xFF\xFF\xFF\xFF");
}

#[test]
fn an_erase_takes_its_sector_and_no_other() {
    let mut flash = blank();
    flash.write(0, b"left").unwrap();
    flash.write(SECOND, b"gone").unwrap();
    flash.0.erased.clear();
    flash.erase(SECOND, END).unwrap();
    assert_eq!(flash.0.erased, [2]);
    assert_eq!(flash.0.cells[0].to_le_bytes(), *b"left");
    assert_eq!(flash.0.cells[SECTOR / WORD], u32::MAX);
}

#[test]
fn the_watchdog_is_fed_between_sectors() {
    let mut flash = Flash(Model::new());
    flash.0.sector_micros = 800_000;
    let start = flash.0.micros();
    flash.erase(0, END).unwrap();
    let mut last = 0;
    for at in flash.0.fed_at.iter().map(|at| at.wrapping_sub(start)) {
        assert!(at - last < 1_300_000, "{at}: hungry since {last}");
        last = at;
    }
    assert!(last >= 1_600_000);
}

#[test]
fn nothing_is_touched_while_the_supply_is_low() {
    for (brown_out_level_3, low_supply, error) in
        [(true, true, Error::Supply), (false, false, Error::BrownOutLevel)]
    {
        let mut flash = blank();
        flash.0.brown_out_level_3 = brown_out_level_3;
        flash.0.low_supply = low_supply;
        assert_eq!(flash.write(0, b"word"), Err(error));
        assert_eq!(flash.erase(0, END), Err(error));
        assert_eq!(flash.0.cells[0], u32::MAX);
        assert_eq!(flash.0.erased, [1, 2], "that was when the supply was good");
        assert!(flash.0.is_locked());
    }
}

#[test]
fn a_flash_that_keeps_nothing_is_found_out() {
    let mut flash = Flash(Model::new());
    flash.0.inert = true;
    assert_eq!(flash.erase(0, END), Ok(()), "blank or not is for who erases to see");
    assert_eq!(flash.write(0, b"word"), Err(Error::Unchanged));
}

#[test]
fn a_refusal_is_told_and_does_not_stick() {
    let mut flash = blank();
    flash.0.protected = true;
    assert_eq!(flash.write(0, b"word"), Err(Error::Refused(WRITE_PROTECTED)));
    flash.0.protected = false;
    assert_eq!(flash.write(4, b"next"), Ok(()));
}

#[test]
fn nothing_is_waited_for_for_ever() {
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
fn ranges_are_checked_first() {
    let mut flash = blank();
    let out = Err(Error::Range(NorFlashErrorKind::OutOfBounds));
    let crooked = Err(Error::Range(NorFlashErrorKind::NotAligned));
    assert_eq!(flash.write(END, b"word"), out);
    assert_eq!(flash.write(2, b"word"), crooked);
    assert_eq!(flash.erase(0, SECOND + 4), crooked);
    assert_eq!(flash.erase(0, 2 * END), out);
    assert_eq!(flash.read(END - 4, &mut [0; 8]), out);
}

#[test]
fn the_journal_keeps_its_settings_on_it() {
    let (mut journal, opened) = Journal::open(Flash(Model::new()));
    assert_eq!(opened, Opened::Damaged, "all zero is neither blank nor a journal");
    journal.save(&Image([7; Image::LENGTH])).unwrap();
    let (_, opened) = Journal::open(journal.release());
    assert_eq!(opened, Opened::Found(Image([7; Image::LENGTH])));
}

#[test]
fn the_journal_on_a_flash_that_keeps_nothing_says_so() {
    let mut flash = Flash(Model::new());
    flash.0.inert = true;
    let (journal, opened) = Journal::open(flash);
    assert_eq!(opened, Opened::Broken(None));
    assert_eq!(journal.room(), 0);
}
