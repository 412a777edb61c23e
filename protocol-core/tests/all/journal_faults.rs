//! D19 on faulty flash: wrong bits, cells and sectors that cannot be programmed or erased, and the emulator's flash,
//! which never changes.

use crate::journal_world::{End, REAL, World, image, report};
use flash_model::{Cut, EraseTear, Flash, Operation, ProgramTear, Random};
use protocol_core::journal::{Journal, Opened, SaveError};
use protocol_core::registers::Image;

/// A flash on which `saves` images were saved, or as many as there is room for, and the last image.
fn saved<const SECTOR: usize>(saves: u64) -> (Flash<SECTOR>, Image) {
    let (mut journal, _) = Journal::open(Flash::<SECTOR>::new(2));
    let count = saves.min(journal.room() as u64);
    for number in 1..=count {
        journal.save(&image(number)).unwrap();
    }
    (journal.release(), image(count))
}

/// Flips each bit of a flash with `saves` images in turn, and checks that the next two starts find the last image. Returns
/// the number of bits.
fn flip_every_bit<const SECTOR: usize>(saves: u64) -> usize {
    let (flash, newest) = saved::<SECTOR>(saves);
    let bits = 2 * SECTOR * 8;
    for bit in 0..bits {
        let mut flash = flash.clone();
        flash.flip(bit);
        for start in 1..3 {
            flash.power_up(start);
            let (journal, opened) = Journal::open(flash);
            assert_eq!(opened, Opened::Found(newest), "bit {bit}, start {start}");
            flash = journal.release();
            assert!(flash.count(Operation::Erase) <= 2 && flash.count(Operation::Program) <= 18);
        }
    }
    bits
}

#[test]
fn any_one_wrong_bit_of_a_full_flash_leaves_the_newest_image() {
    let small: usize = [1, 8, 10, 11, 22].map(flip_every_bit::<512>).iter().sum();
    let real: usize = [400, 1_013].map(flip_every_bit::<REAL>).iter().sum();
    report("any one wrong bit of a full flash", &format!("{} bits", small + real));
}

#[test]
fn any_two_wrong_bits_of_the_newest_record_make_no_other_image() {
    let (flash, newest) = saved::<512>(6);
    let (_, before) = saved::<512>(5);
    // Slot 1 says that there are no settings yet. After six saves, the newest record is in slot 7.
    let record = 7 * 256..8 * 256;
    let (mut kept, mut lost) = (0, 0);
    for first in record.clone() {
        for second in first + 1..record.end {
            let mut flash = flash.clone();
            flash.flip(first);
            flash.flip(second);
            match Journal::open(flash).1 {
                Opened::Found(found) if found == newest => kept += 1,
                Opened::Found(found) if found == before => lost += 1,
                other => panic!("bits {first} and {second}: {other:?}"),
            }
        }
    }
    println!("two wrong bits: {kept} kept the newest image, {lost} went back to the one before");
    assert_eq!(kept + lost, 256 * 255 / 2);
    report("any two wrong bits of the newest record", &format!("{} pairs", kept + lost));
}

#[test]
fn a_flash_that_takes_nothing_is_broken_and_the_arm_goes_on() {
    // The emulator's flash reads 0 everywhere; a write-protected flash may be blank.
    for bytes in [vec![0; 2 * REAL], vec![0xFF; 2 * REAL]] {
        let (mut journal, opened) = Journal::open(Flash::<REAL>::inert(&bytes));
        assert_eq!((opened, opened.image(), journal.room()), (Opened::Broken(None), None, 0));
        assert_eq!(journal.save(&image(1)), Err(SaveError::Broken));
        assert_eq!(journal.save(&image(2)), Err(SaveError::Broken));
        assert_eq!(Journal::open(journal.release()).1, opened);
    }
}

#[test]
fn a_write_protected_flash_gives_its_settings_and_takes_no_others() {
    for (saves, refusal) in [(100, SaveError::Broken), (2_000, SaveError::Full)] {
        let (flash, newest) = saved::<REAL>(saves);
        let (mut journal, opened) = Journal::open(Flash::<REAL>::inert(flash.bytes()));
        assert_eq!(opened, Opened::Found(newest));
        assert_eq!(journal.save(&image(9_000)), Err(refusal));
        assert_eq!(journal.save(&newest), if saves == 100 { Err(refusal) } else { Ok(()) });
        assert_eq!(Journal::open(journal.release()).1, opened);
    }
    // A flash whose newest record is in doubt, and cannot be made firm.
    let (mut flash, newest) = saved::<REAL>(100);
    flash.flip(101 * 256 + 70);
    let (journal, opened) = Journal::open(Flash::<REAL>::inert(flash.bytes()));
    assert_eq!((opened, journal.room()), (Opened::Broken(Some(newest)), 0));
    assert_eq!(opened.image(), Some(&newest));
}

#[test]
fn a_flash_that_is_too_small_is_broken() {
    let (mut journal, opened) = Journal::open(Flash::<512>::new(1));
    assert_eq!(opened, Opened::Broken(None));
    assert_eq!((journal.room(), journal.save(&image(1))), (0, Err(SaveError::Broken)));
}

#[test]
fn one_sector_that_does_not_get_blank_leaves_the_other() {
    for worn_out in [0, 1] {
        let mut flash = Flash::<512>::new(2);
        flash.flip(worn_out * 4_096 + 999);
        flash.wear_out_sector(worn_out);
        let (mut journal, opened) = Journal::open(flash);
        assert!(matches!(opened, Opened::Damaged), "{opened:?}");
        let room = journal.room() as u64;
        assert_eq!(room, 10);
        (1..=room).for_each(|number| journal.save(&image(number)).unwrap());
        assert_eq!(journal.save(&image(99)), Err(SaveError::Full));
        for _ in 0..3 {
            let (again, opened) = Journal::open(journal.release());
            assert_eq!((opened, again.room()), (Opened::Found(image(room)), 0));
            journal = again;
        }
    }
}

#[test]
fn a_sector_that_wears_out_loses_nothing() {
    for (saves, worn_out) in (0..40).flat_map(|saves| [(saves, 0), (saves, 1)]) {
        let (mut flash, mut newest) = saved::<512>(saves);
        flash.wear_out_sector(worn_out);
        let before = if saves == 0 { Opened::Fresh } else { Opened::Found(newest) };
        let (mut journal, opened) = Journal::open(flash);
        assert_eq!(opened, before);
        for number in 100..140 {
            newest = if journal.save(&image(number)).is_ok() { image(number) } else { newest };
            if number % 9 == 0 {
                let (again, opened) = Journal::open(journal.release());
                assert_eq!(opened, Opened::Found(newest), "{saves} saves, sector {worn_out}, then {number}");
                journal = again;
            }
        }
    }
}

#[test]
fn a_cell_that_stays_one_costs_a_second_slot_and_the_first_gets_no_seal() {
    for bit in 0..256 {
        let (mut flash, _) = saved::<512>(4);
        // Slots 1 to 5 are full, and the next start skips slot 6.
        flash.wear_out_bit(7 * 256 + bit);
        flash.power_up(1);
        let (mut journal, _) = Journal::open(flash);
        let room = journal.room();
        assert_eq!(journal.save(&image(50)), Ok(()));
        let slots = room - journal.room();
        let flash = journal.release();
        let (programs, sealed) = (flash.count(Operation::Program), flash.bytes()[252..256] != [0xFF; 4]);
        match slots {
            1 => assert_eq!((programs, sealed), (8, true), "bit {bit}"),
            _ => assert_eq!((slots, programs, sealed), (2, if bit < 224 { 15 } else { 16 }, bit >= 224)),
        }
        assert_eq!(Journal::open(flash).1, Opened::Found(image(50)), "bit {bit}");
    }
}

#[test]
fn a_save_tries_two_slots_and_no_more() {
    let (flash, _) = saved::<512>(4);
    let (mut journal, _) = Journal::open(Flash::<512>::inert(flash.bytes()));
    for _ in 0..3 {
        let room = journal.room();
        assert_eq!(journal.save(&image(50)), Err(SaveError::Broken));
        assert_eq!(room - journal.room(), 2);
    }
}

/// At the next start, a record that was begun in the spare may count as newer than home, so home accepts no more saves.
#[test]
fn a_move_that_fails_is_the_end_of_saving_but_not_of_the_settings() {
    let (mut flash, newest) = saved::<512>(8);
    // Wear out a bit of the seal that has to become 0, in both slots that a move tries.
    let worn_out = [1, 2].map(|slot| 4_096 + slot * 256 + 224);
    worn_out.into_iter().for_each(|bit| flash.wear_out_bit(bit));
    let (mut journal, opened) = Journal::open(flash);
    assert_eq!((opened, journal.room()), (Opened::Broken(Some(newest)), 0));
    assert_eq!(journal.save(&image(50)), Err(SaveError::Broken));
    let (mut journal, opened) = Journal::open(journal.release());
    assert_eq!(opened, Opened::Found(newest), "the next start goes on behind the worn slots");
    assert_eq!(journal.save(&image(51)), Ok(()));
    assert_eq!(Journal::open(journal.release()).1, Opened::Found(image(51)));
}

#[test]
fn what_is_no_log_is_damaged_and_becomes_one() {
    let mut random = Random::new(5);
    let noise: Vec<_> = (0..2 * REAL).map(|_| random.next().to_le_bytes()[0]).collect();
    let blank_half: Vec<_> = noise.iter().copied().take(REAL).chain(vec![0xFF; REAL]).collect();
    for bytes in [noise, blank_half, vec![0; 2 * REAL], vec![0x55; 2 * REAL]] {
        let (mut journal, opened) = Journal::open(Flash::<REAL>::holding(&bytes));
        assert_eq!(opened, Opened::Damaged);
        assert_eq!(Journal::open(journal.clone().release()).1, Opened::Fresh);
        assert_eq!(journal.save(&image(1)), Ok(()));
        assert_eq!(Journal::open(journal.release()).1, Opened::Found(image(1)));
    }
}

#[test]
fn noise_in_the_spare_leaves_the_settings() {
    let mut random = Random::new(6);
    let (flash, newest) = saved::<REAL>(20);
    let home = flash.bytes().iter().copied().take(REAL);
    let noise = (0..REAL).map(|_| random.next().to_le_bytes()[0]);
    let flash = Flash::<REAL>::holding(&home.chain(noise).collect::<Vec<_>>());
    assert_eq!(Journal::open(flash).1, Opened::Found(newest));
}

/// A word whose programming is cut at its very beginning may leave no trace. If the cut disturbed bits that were to stay
/// ones, a record in this slot would not last. So the slot is not used again, unless its record was the first of a power cycle.
#[test]
fn a_slot_that_was_begun_without_a_trace_is_skipped() {
    let mut cases = 0;
    for saves in 1..8 {
        let mut world = World::<512>::new();
        assert_eq!(world.cycle(1, None), End::Quiet);
        for seed in 0..200 {
            let mut world = world.clone();
            let cut = Cut { after: 8 * saves, program: ProgramTear::Disturbed, erase: EraseTear::All, seed };
            assert_eq!(world.cycle(9, Some(cut)), End::Cut);
            world.settle();
            world.settle();
            assert_eq!(world.flash.borrow().reprogrammed(), 0, "seed {seed}");
            cases += 1;
        }
    }
    report("records cut at their very beginning", &format!("{cases} records"));
}
