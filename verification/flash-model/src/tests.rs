//! Tests of the model: effects of operations and power cuts, and refusals.

use embedded_storage::nor_flash::{NorFlash, NorFlashErrorKind, ReadNorFlash};

use crate::*;

type Small = Flash<512>;

const CUT: Cut = Cut { after: 0, program: ProgramTear::All, erase: EraseTear::All, seed: 1 };

fn read(flash: &mut Small, address: u32) -> Result<u32, Error> {
    let mut bytes = [0; 4];
    flash.read(address, &mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}

/// The value of a word after each of 64 power-ups.
fn readings(flash: &mut Small, address: u32) -> Vec<u32> {
    let reading = |start| {
        flash.power_up(start);
        read(flash, address).unwrap()
    };
    (0..64).map(reading).collect()
}

#[test]
fn programming_clears_bits_and_erasing_sets_all_of_a_sector() {
    let mut flash = Small::new(2);
    assert_eq!(flash.write(8, &[1, 2, 3, 4, 5, 6, 7, 8]), Ok(()));
    assert_eq!((read(&mut flash, 8), read(&mut flash, 12)), (Ok(0x0403_0201), Ok(0x0807_0605)));
    assert_eq!(flash.write(512, &[0; 4]), Ok(()));
    assert_eq!(flash.erase(0, 512), Ok(()));
    assert_eq!((read(&mut flash, 8), read(&mut flash, 512)), (Ok(u32::MAX), Ok(0)));
    assert_eq!((flash.count(Operation::Program), flash.count(Operation::Erase)), (3, 1));
}

#[test]
fn a_word_takes_another_value_only_after_an_erase() {
    let mut flash = Small::new(2);
    assert_eq!(flash.write(0, &[0xF0; 4]), Ok(()));
    assert_eq!(flash.write(0, &[0xF0; 4]), Ok(()));
    assert_eq!(flash.reprogrammed(), 1);
    assert_eq!(flash.write(0, &[0x70; 4]), Err(Error::ProgrammedTwice));
    assert_eq!(flash.erase(0, 512), Ok(()));
    assert_eq!(flash.write(0, &[0x70; 4]), Ok(()));
}

#[test]
fn bounds_and_alignment_are_those_of_the_contract() {
    let mut flash = Small::new(2);
    assert_eq!(flash.write(2, &[0; 4]), Err(Error::Misused(NorFlashErrorKind::NotAligned)));
    assert_eq!(flash.write(1_024, &[0; 4]), Err(Error::Misused(NorFlashErrorKind::OutOfBounds)));
    assert_eq!(flash.erase(0, 256), Err(Error::Misused(NorFlashErrorKind::NotAligned)));
    assert_eq!(flash.read(1_023, &mut [0; 2]), Err(Error::Misused(NorFlashErrorKind::OutOfBounds)));
}

#[test]
fn every_access_fails_between_a_cut_and_the_next_power_up() {
    let mut flash = Small::new(2);
    flash.cut_power(Cut { after: 1, program: ProgramTear::Bytes(2), ..CUT });
    assert_eq!(flash.write(0, &[0; 8]), Err(Error::PowerLost));
    assert!(!flash.is_powered());
    assert_eq!(read(&mut flash, 0), Err(Error::PowerLost));
    assert_eq!(flash.erase(0, 512), Err(Error::PowerLost));
    flash.power_up(7);
    assert_eq!((read(&mut flash, 0), read(&mut flash, 4)), (Ok(0), Ok(0xFFFF_0000)));
}

#[test]
fn every_program_tear_changes_the_documented_bits() {
    let expected = |tear, reading: u32| match tear {
        ProgramTear::Nothing => reading == u32::MAX,
        ProgramTear::All => reading == 0xFF00_FF00,
        ProgramTear::Bytes(1) => reading == 0xFFFF_FF00,
        ProgramTear::Bytes(2) => reading == 0xFFFF_FF00,
        ProgramTear::Bytes(_) => reading == 0xFF00_FF00,
        ProgramTear::OneBit => reading.count_zeros() == 1,
        ProgramTear::AllButOne => reading.count_zeros() == 15,
        ProgramTear::OneMarginal => reading.count_zeros() >= 15,
        ProgramTear::TwoMarginal => reading.count_zeros() >= 14,
        ProgramTear::FaintOne => reading.count_zeros() <= 1,
        ProgramTear::FaintTwo | ProgramTear::Disturbed => reading.count_zeros() <= 2,
        ProgramTear::RandomBits | ProgramTear::MarginalWord => true,
    };
    for tear in ProgramTear::ALL.into_iter().chain([ProgramTear::Disturbed]) {
        let mut flash = Small::new(2);
        flash.cut_power(Cut { program: tear, ..CUT });
        assert_eq!(flash.write(4, &[0x00, 0xFF, 0x00, 0xFF]), Err(Error::PowerLost));
        for reading in readings(&mut flash, 4) {
            assert!(expected(tear, reading), "{tear:?} reads {reading:08x}");
            let stays = tear == ProgramTear::Disturbed || reading & 0xFF00_FF00 == 0xFF00_FF00;
            assert!(stays, "{tear:?} cleared a bit that should stay set");
        }
        assert_eq!(readings(&mut flash, 0), [u32::MAX; 64]);
    }
}

#[test]
fn marginal_bits_are_stable_while_the_power_is_on_and_firm_after_a_program() {
    let mut flash = Small::new(2);
    flash.cut_power(Cut { program: ProgramTear::MarginalWord, ..CUT });
    assert_eq!(flash.write(0, &[0; 4]), Err(Error::PowerLost));
    let seen = readings(&mut flash, 0);
    assert!(seen.iter().any(|reading| *reading != seen[0]), "{seen:x?}");
    assert_eq!(read(&mut flash, 0), read(&mut flash, 0));
    assert_eq!(flash.write(0, &[0; 4]), Ok(()));
    assert_eq!(readings(&mut flash, 0), [0; 64]);
}

#[test]
fn a_sector_whose_erase_was_cut_refuses_programs_until_it_is_erased() {
    for tear in EraseTear::ALL {
        let mut flash = Small::new(2);
        flash.write(256, &[0; 256]).unwrap();
        flash.cut_power(Cut { erase: tear, ..CUT });
        assert_eq!(flash.erase(0, 512), Err(Error::PowerLost));
        flash.power_up(3);
        let untouched = matches!(tear, EraseTear::Nothing | EraseTear::All);
        let expected = if untouched { Ok(()) } else { Err(Error::HalfErased) };
        assert_eq!(flash.write(0, &[0; 4]), expected, "{tear:?}");
        assert_eq!(flash.write(512, &[0; 4]), Ok(()), "{tear:?}");
        assert_eq!(flash.erase(0, 512), Ok(()));
        assert!(flash.bytes().iter().take(512).all(|byte| *byte == 0xFF), "{tear:?}");
        assert_eq!(readings(&mut flash, 256), [u32::MAX; 64], "{tear:?}");
        assert_eq!(flash.write(0, &[0; 4]), Ok(()), "{tear:?}");
    }
}

#[test]
fn erases_can_be_forbidden_until_the_next_power_up() {
    let mut flash = Small::new(2);
    flash.forbid_erase();
    assert_eq!(flash.erase(0, 512), Err(Error::EraseForbidden));
    flash.power_up(1);
    assert_eq!(flash.erase(0, 512), Ok(()));
}

#[test]
fn worn_cells_and_sectors_do_not_change() {
    let mut flash = Small::new(2);
    flash.wear_out_bit(32 + 5);
    assert_eq!(flash.write(4, &[0; 4]), Ok(()));
    assert_eq!(read(&mut flash, 4), Ok(1 << 5));
    flash.wear_out_sector(0);
    assert_eq!(flash.erase(0, 1_024), Ok(()));
    assert_eq!(read(&mut flash, 4), Ok(1 << 5));
    flash.flip(32);
    assert_eq!(read(&mut flash, 4), Ok(0x21));
}

#[test]
fn an_inert_flash_accepts_every_operation_and_changes_nothing() {
    let mut flash = Small::inert(&[0; 1_024]);
    assert_eq!(flash.erase(0, 1_024), Ok(()));
    assert_eq!(flash.write(0, &[0x55; 8]), Ok(()));
    assert_eq!(read(&mut flash, 0), Ok(0));
}

#[test]
fn words_may_be_single_bytes() {
    let mut flash = Flash::<512, 1>::new(1);
    flash.cut_power(Cut { after: 3, program: ProgramTear::Nothing, ..CUT });
    assert_eq!(flash.write(1, &[1, 2, 3, 4]), Err(Error::PowerLost));
    assert_eq!(flash.bytes().get(..6), Some([0xFF, 1, 2, 3, 0xFF, 0xFF].as_slice()));
}
