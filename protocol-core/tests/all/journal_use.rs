//! D19 on a sound flash: how much fits, what it costs, and what the two sectors hold byte by byte.

use crate::journal_world::{End, REAL, World, cuts, image};
use flash_model::{Flash, Operation, ProgramTear};
use protocol_core::journal::{Journal, Opened, SaveError};
use protocol_core::registers::Image;

/// Two saves, in a layout that must stay readable once arms have it in their flash.
#[test]
fn golden_flash_image() {
    const FF: [u8; 4] = [0xFF; 4];
    const ZERO: [u8; 4] = [0; 4];
    const GENERATION_1: [u8; 4] = [1, 0, 0, 0];
    const SEAL: [u8; 4] = [0x5E, 0xA1, 0xC3, 0x96];
    let first_sector = [
        // The mark of generation 1.
        [[0x79, 0xB8, 0xF8, 0x99], FF, FF, FF, FF, FF, FF, FF],
        // No settings yet.
        [GENERATION_1, FF, FF, FF, FF, FF, [0x3A, 0x46, 0xC6, 0x01], SEAL],
        // Device id 42.
        [GENERATION_1, [0, 0, 0, 42], ZERO, ZERO, ZERO, ZERO, [0xA4, 0x42, 0x6B, 0x3E], SEAL],
        // Joint offsets 1, 2, 3, -4, -5, -6, 7.
        [
            GENERATION_1,
            [0, 0, 0, 42],
            [0, 1, 2, 3],
            [0x84, 0x85, 0x86, 7],
            ZERO,
            ZERO,
            [0xE2, 0xE8, 0x39, 0x31],
            SEAL,
        ],
    ];
    // The mark of generation 2.
    let second_sector = [[[0x97, 0x17, 0x4D, 0x8B], FF, FF, FF, FF, FF, FF, FF]];
    let mut expected = [0xFF; 1_024];
    expected[..128].copy_from_slice(first_sector.as_flattened().as_flattened());
    expected[512..544].copy_from_slice(second_sector.as_flattened().as_flattened());

    let (mut journal, opened) = Journal::open(Flash::<512>::new(2));
    assert_eq!(opened, Opened::Fresh);
    let mut settings = Image([0; 20]);
    settings.0[3] = 42;
    journal.save(&settings).unwrap();
    settings.0[5..12].copy_from_slice(&[1, 2, 3, 0x84, 0x85, 0x86, 7]);
    journal.save(&settings).unwrap();
    assert_eq!(journal.release().bytes(), expected);
    assert_eq!(Journal::open(Flash::<512>::holding(&expected)).1, Opened::Found(settings));
}

#[test]
fn a_flash_that_was_never_used_holds_no_settings_until_something_is_saved() {
    let mut flash = Flash::<REAL>::new(2);
    for _ in 0..3 {
        let (journal, opened) = Journal::open(flash);
        assert_eq!((opened, opened.image()), (Opened::Fresh, None));
        flash = journal.release();
    }
    let (mut journal, _) = Journal::open(flash);
    assert_eq!(journal.save(&image(1)), Ok(()));
    assert_eq!(Journal::open(journal.release()).1, Opened::Found(image(1)));
}

#[test]
fn a_power_cycle_takes_600_saves_however_full_the_flash_was() {
    let mut least = usize::MAX;
    let (mut world, mut saves) = (World::<REAL>::new(), 0);
    while saves < 1_100 {
        let mut flash = world.flash.borrow().clone();
        flash.power_up(1);
        let room = Journal::open(flash).0.room();
        least = least.min(room);
        // As many saves as there is room for, then three that are refused.
        assert_eq!(world.clone().cycle(room + 3, None), End::Quiet);
        assert_eq!(world.cycle(saves, None), End::Quiet);
        saves += 7;
    }
    println!("at least {least} saves in a power cycle");
    assert!(least >= 600);
}

#[test]
fn a_full_flash_refuses_and_keeps_what_it_has() {
    let (mut journal, _) = Journal::open(Flash::<REAL>::new(2));
    let room = journal.room() as u64;
    (1..=room).for_each(|number| journal.save(&image(number)).unwrap());
    assert_eq!((journal.room(), journal.save(&image(room + 1))), (0, Err(SaveError::Full)));
    assert_eq!(journal.save(&image(room)), Ok(()), "what is there already needs no room");
    let (journal, opened) = Journal::open(journal.release());
    assert_eq!(opened, Opened::Found(image(room)));
    assert!(journal.room() >= 600);
}

/// Home is as full as saves can make it, and the spare is not blank: for this case some slots are reserved for starts.
#[test]
fn what_is_in_doubt_is_appended_again_before_anything_is_erased() {
    use Operation::{Erase, Program};
    let world = World::<512>::new();
    let saves = Journal::open(Flash::<512>::new(2)).0.room();
    let seal_of_the_last = world.operations(saves).len() - 1;
    for cut in cuts(seal_of_the_last, Program, 1) {
        let mut world = world.clone();
        assert_eq!(world.cycle(saves, Some(cut)), End::Cut);
        let in_doubt = cut.program != ProgramTear::All;
        let expected: Vec<_> = [[Program; 8].as_slice(), &[Erase, Program], &[Program; 8], &[Erase, Program]]
            .into_iter()
            .skip(if in_doubt { 0 } else { 1 })
            .flatten()
            .copied()
            .collect();
        assert_eq!(world.operations(0), expected, "{cut:?}");
    }
}

#[test]
fn a_start_moves_to_the_spare_when_less_than_a_quarter_of_home_is_free() {
    use Operation::{Erase, Program};
    // Of the 16 slots, one holds the mark and one the record without settings. A start skips one, and four are reserved for
    // starts.
    for (saves, moves) in [(5, false), (6, true)] {
        let mut world = World::<512>::new();
        assert_eq!(world.cycle(saves, None), End::Quiet);
        let moved = [[Program; 8].as_slice(), &[Erase, Program]].concat();
        assert_eq!(world.operations(0), if moves { moved } else { vec![] }, "{saves} saves");
    }
}

#[test]
fn what_is_already_there_is_not_written_again() {
    let (mut journal, _) = Journal::open(Flash::<REAL>::new(2));
    journal.save(&image(1)).unwrap();
    let mut flash = journal.release();
    for start in 0..1_000 {
        flash.power_up(start);
        let (mut journal, opened) = Journal::open(flash);
        assert_eq!((opened, journal.save(&image(1))), (Opened::Found(image(1)), Ok(())));
        flash = journal.release();
        assert_eq!(flash.history(), []);
    }
}

#[test]
fn an_erase_serves_hundreds_of_saves() {
    let mut flash = Flash::<REAL>::new(2);
    let (mut erases, mut number) = (0, 0);
    for start in 0..2_000 {
        flash.power_up(start);
        let (mut journal, _) = Journal::open(flash);
        for _ in 0..3 {
            number += 1;
            journal.save(&image(number)).unwrap();
        }
        flash = journal.release();
        erases += flash.count(Operation::Erase);
    }
    println!("{number} saves in power cycles of three cost {erases} erases");
    assert!(erases as u64 * 250 < number);
}

#[test]
fn words_of_one_or_two_bytes_do_as_well() {
    fn save_and_start<const WORD: usize>() {
        let mut flash = Flash::<1_024, WORD>::new(2);
        for number in 1..200 {
            let (mut journal, _) = Journal::open(flash);
            assert_eq!(journal.save(&image(number)), Ok(()));
            let (journal, opened) = Journal::open(journal.release());
            assert_eq!(opened, Opened::Found(image(number)));
            flash = journal.release();
        }
    }
    save_and_start::<1>();
    save_and_start::<2>();
}
