//! Tests of the flash driver against the rules of the chip (RM0090, section 3).

mod chip_model;

use chip_model::*;
use flash_model::FlashSupply;
use protocol_core::journal::{Journal, Opened};
use protocol_core::registers::Image;

use super::*;

/// The number of the journal's first sector. The journal has sectors 1 and 2.
const FIRST_SECTOR: usize = 1;
/// Offset of the journal's second sector.
const SECOND: u32 = 16 * 1024;
/// Offset behind the journal.
const END: u32 = 2 * SECOND;
const WRITE_PROTECTED: u32 = 1 << 4;

fn blank() -> Flash<ChipModel> {
    let mut flash = Flash::new(ChipModel::new());
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
    let mut flash = Flash::new(ChipModel::new());
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
    let mut flash = Flash::new(ChipModel::supplied(FlashSupply::steady(2_750)));
    assert_eq!(flash.erase(0, END), Err(Error::Supply));
    assert_eq!(flash.write(0, b"word"), Err(Error::Supply));
    assert!(flash.0.erased.is_empty() && flash.0.is_locked());
}

#[test]
fn a_supply_of_3v3_less_5_percent_is_good() {
    let lowest = 3_300 - 3_300 * 5 / 100;
    let mut flash = Flash::new(ChipModel::supplied(FlashSupply::steady(lowest)));
    assert_eq!(flash.erase(0, END), Ok(()));
}

#[test]
fn a_sag_stops_a_write_before_the_supply_is_too_low_for_a_word() {
    // The erase of both sectors takes 0.5 s. Then the supply falls by 1 mV per 10 us, stays at 2.5 V for 1 ms, and rises.
    let sag = FlashSupply::steady(3_300).then(600_000, 3_300).then(608_000, 2_500);
    let sag = sag.then(609_000, 2_500).then(617_000, 3_300);
    let mut flash = Flash::new(ChipModel::supplied(sag));
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
    let mut flash = Flash::new(ChipModel::inert());
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
    let (mut journal, opened) = Journal::open(Flash::new(ChipModel::new()));
    assert_eq!(opened, Opened::Damaged, "all zeros are neither blank nor a journal");
    journal.save(&Image([7; Image::LENGTH])).unwrap();
    let (_, opened) = Journal::open(journal.release());
    assert_eq!(opened, Opened::Found(Image([7; Image::LENGTH])));
}

#[test]
fn the_journal_reports_a_flash_that_changes_nothing() {
    let (journal, opened) = Journal::open(Flash::new(ChipModel::inert()));
    assert_eq!(opened, Opened::Broken(None));
    assert_eq!(journal.room(), 0);
}
