//! D19: the power is cut at each program and each erase operation, in every way that the flash model has, and cut again
//! before a start has repaired the damage of the first cut. A start finds the settings before or after a save, never others.
//!
//! With `JOURNAL_LONG=1` the tests try much more. `JOURNAL_SEED=n` sets the seed of the random cuts. The test of three
//! cuts in a row is ignored by default. How much was tried is printed (`--nocapture`).

use crate::journal_world::{End, REAL, World, cuts, every_cut, image, report};
use flash_model::{Cut, EraseTear, Flash, Operation, ProgramTear, Random};
use protocol_core::journal::{Journal, Opened};

fn is_long() -> bool {
    std::env::var_os("JOURNAL_LONG").is_some()
}

/// What was tried.
#[derive(Debug, Default)]
struct Tally {
    updates: u64,
    operations: usize,
    cases: u64,
    most_erases: usize,
    most_programs: usize,
}

impl Tally {
    fn report(&self, tried: &str) {
        let Self { updates, operations, cases, most_erases, most_programs } = self;
        let steps = if *operations > 0 { format!("{operations} steps, ") } else { String::new() };
        println!(
            "{tried}: {updates} updates, {most_erases} erases and {most_programs} programs a start at most"
        );
        report(tried, &format!("{steps}{cases} cuts"));
    }

    /// Runs some quiet power cycles, with their checks, and counts the case.
    fn settle<const SECTOR: usize>(&mut self, mut world: World<SECTOR>) {
        world.settle();
        self.cases += 1;
        self.most_erases = self.most_erases.max(world.most.0);
        self.most_programs = self.most_programs.max(world.most.1);
    }
}

/// Cuts the power once in each cycle, at every operation and in every way. `cycles` has the number of saves of each cycle.
fn cut_everything_once<const SECTOR: usize>(cycles: impl IntoIterator<Item = usize>) {
    let tally = cut_everything_once_in(World::<SECTOR>::new(), cycles);
    tally.report(&format!("{SECTOR} B sectors, power cut at every step in 25 ways"));
}

fn cut_everything_once_in<const SECTOR: usize>(
    mut world: World<SECTOR>,
    cycles: impl IntoIterator<Item = usize>,
) -> Tally {
    let mut tally = Tally::default();
    for saves in cycles {
        let operations = world.operations(saves).len();
        // A cycle that fills the flash takes long, so the power is cut only at its last operations.
        let from = if saves > 100 { operations - 80 } else { 0 };
        tally.operations += operations - from;
        every_cut(&world, saves, from).for_each(|world| tally.settle(world));
        assert_eq!(world.cycle(saves, None), End::Quiet);
    }
    tally.updates = world.images;
    tally
}

#[test]
fn a_cut_at_every_step_of_a_thousand_updates_of_the_real_flash() {
    let cycles = (0..6 * 44).map(|cycle| [3, 1, 11, 0, 6, 2][cycle % 6]);
    // The last cycles fill home and continue in the spare, some of them up to its end.
    cut_everything_once::<REAL>(cycles.chain([380, 2, 380, 640, 1, 900, 1200, 3]));
}

#[test]
fn a_cut_at_every_step_of_a_thousand_updates_of_small_flashes() {
    let cycles = || (0..).map(|cycle| [2, 5, 1, 13, 3, 0, 30, 7][cycle % 8]);
    cut_everything_once::<512>(cycles().take(240));
    cut_everything_once::<1_024>(cycles().take(240));
    cut_everything_once::<2_048>(cycles().take(240));
}

/// No flash lives for so many generations. But a damaged flash, or an image file with any content, may hold the last one.
#[test]
fn the_first_generation_follows_the_last() {
    const LAST: u32 = u32::MAX / 2;
    for generation in LAST - 9..=LAST {
        let world = World::<512>::holding(generation, image(9_999));
        let tally = cut_everything_once_in(world, [0, 5, 12, 3, 0, 12, 12, 1]);
        assert_eq!(tally.most_erases, 2);
    }
    for no_generation in [LAST + 1, u32::MAX] {
        let world = World::<512>::holding(no_generation, image(9_999));
        assert_eq!(Journal::open(world.flash.borrow().clone()).1, Opened::Damaged);
    }
}

/// Cuts the power at every operation of each cycle, in every way. Then likewise during the next start and its saves, until
/// there were `cuts` cuts in a row.
fn cut_everything_again<const SECTOR: usize>(
    cycles: impl IntoIterator<Item = usize>,
    saves_after: usize,
    cuts: u32,
) -> Tally {
    let (mut world, mut tally) = (World::<SECTOR>::new(), Tally::default());
    for saves in cycles {
        every_cut(&world, saves, 0).for_each(|world| cut_again(world, saves_after, cuts - 1, &mut tally));
        assert_eq!(world.cycle(saves, None), End::Quiet);
    }
    tally.updates = world.images;
    tally.report(&format!("{SECTOR} B sectors, {cuts} cuts in a row, each at every step"));
    tally
}

fn cut_again<const SECTOR: usize>(world: World<SECTOR>, saves: usize, cuts: u32, tally: &mut Tally) {
    if cuts == 0 {
        tally.settle(world);
    } else {
        every_cut(&world, saves, 0).for_each(|world| cut_again(world, saves, cuts - 1, tally));
    }
}

#[test]
fn a_second_cut_at_every_step_before_the_first_is_mended() {
    // The numbers of saves give the first start, a change-over, and a flash that is full to its end.
    let tally = cut_everything_again::<512>([0, 2, 14, 23], 1, 2);
    assert!(tally.cases >= 100_000, "{tally:?}");
    assert_eq!((tally.most_erases, tally.most_programs), (2, 18), "the bounds are not put to the test");
    if is_long() {
        cut_everything_again::<512>([0, 2, 14, 1, 23, 1], 3, 2);
        cut_everything_again::<1_024>([1, 3, 30, 1, 55, 2, 0], 2, 2);
    }
}

#[test]
#[ignore = "takes minutes"]
fn a_third_cut_at_every_step_before_the_others_are_mended() {
    // After the first cut, the cycles of the first call have no saves, and those of the second call have one each.
    cut_everything_again::<512>([0, 1, 13], 0, 3);
    cut_everything_again::<512>([1], 1, 3);
}

/// Runs power cycles with random numbers of saves. In seven of eight, the power is cut at a random operation, if the cycle has
/// that many.
fn cut_at_random<const SECTOR: usize>(cycles: u64, most_saves: usize) {
    let seed = std::env::var("JOURNAL_SEED").map_or(2_026, |seed| seed.parse().unwrap());
    println!("{SECTOR} B sectors, JOURNAL_SEED={seed}");
    let mut random = Random::new(seed);
    let mut world = World::<SECTOR>::new();
    let mut cuts = 0;
    for _ in 0..cycles {
        let saves = random.index(most_saves);
        let after = random.index(10 + 8 * saves);
        let program = ProgramTear::ALL[random.index(ProgramTear::ALL.len())];
        let erase = EraseTear::ALL[random.index(EraseTear::ALL.len())];
        let cut = Cut { after, program, erase, seed: random.next() };
        let end = world.cycle(saves, (random.below(8) > 0).then_some(cut));
        cuts += u64::from(end == End::Cut);
        world.forget_past(end);
    }
    let tried = format!("{SECTOR} B sectors, cut at random, JOURNAL_SEED={seed}");
    report(&tried, &format!("{cycles} power cycles, {cuts} cuts"));
}

#[test]
fn cuts_at_random_in_long_lives() {
    let times = if is_long() { 10 } else { 1 };
    cut_at_random::<512>(150_000 * times, 24);
    cut_at_random::<1_024>(100_000 * times, 60);
    cut_at_random::<REAL>(4_000 * times, 1_000);
}

/// Cuts the power in each erase of some power cycles, and returns the number of cases. The result of an interrupted erase is
/// random, so each kind of cut is tried `chances` times.
fn cut_erases<const SECTOR: usize>(chances: usize) -> u64 {
    let mut world = World::<SECTOR>::new();
    let mut cases = 0;
    // Some of these cycles continue in the spare, so that the start after them erases one sector or two.
    for saves in [1, SECTOR / 32, SECTOR / 16, SECTOR / 20, 0] {
        let operations = world.operations(saves).into_iter().enumerate();
        for (after, _) in operations.filter(|(_, operation)| *operation == Operation::Erase) {
            let tears = EraseTear::ALL.into_iter().cycle().take(EraseTear::ALL.len() * chances);
            for (number, erase) in (0_u64..).zip(tears) {
                let mut world = world.clone();
                let cut = Cut { after, program: ProgramTear::All, erase, seed: world.seed ^ number };
                assert_eq!(world.cycle(saves, Some(cut)), End::Cut);
                world.settle();
                cases += 1;
            }
        }
        assert_eq!(world.cycle(saves, None), End::Quiet);
    }
    report(&format!("{SECTOR} B sectors, erases cut in 12 ways"), &format!("{cases} erases"));
    cases
}

#[test]
fn a_cut_erase_loses_nothing_whatever_it_leaves() {
    assert!(cut_erases::<512>(200) >= 1_500);
    assert!(cut_erases::<REAL>(if is_long() { 200 } else { 30 }) >= 1_500);
}

/// A flash whose home is full, and whose spare is half full of the remains of interrupted moves.
fn spare_full_of_remains() -> World<512> {
    let mut world = World::new();
    assert_eq!(world.cycle(9, None), End::Quiet);
    fill_spare_with_remains(&mut world);
    world
}

/// Cuts the power in each start that begins with a move to the spare, until a start does not.
fn fill_spare_with_remains(world: &mut World<512>) {
    while world.operations(0).starts_with(&[Operation::Program; 8]) {
        assert_eq!(world.cycle(0, Some(torn_after(4))), End::Cut);
    }
}

/// A cut after `after` operations that leaves half a word.
fn torn_after(after: usize) -> Cut {
    Cut { after, program: ProgramTear::Bytes(2), erase: EraseTear::All, seed: 1 }
}

#[test]
fn a_mark_is_revoked_seven_times_each_with_a_word_of_its_own() {
    use Operation::{Erase, Program};
    let mut world = spare_full_of_remains();
    for times in 1..=7 {
        assert_eq!(world.operations(0)[..3], [Program, Erase, Program], "note, erase, mark");
        assert_eq!(world.cycle(0, Some(torn_after(3 + 4))), End::Cut);
        fill_spare_with_remains(&mut world);
        let flash = world.flash.borrow();
        let words = flash.bytes()[4..32].chunks(4).map(|word| word != [0xFF; 4]);
        assert!(words.eq((1..=7).map(|word| word <= times)), "behind home's mark, {times} times");
    }
    assert_eq!(world.operations(0)[..2], [Erase, Program], "no place for one more");
    world.settle();
}

#[test]
fn a_first_start_that_was_cut_in_its_record_left_nothing_that_is_damaged() {
    for (after, cut) in
        (2..10).flat_map(|after| cuts(after, Operation::Program, 1).map(move |cut| (after, cut)))
    {
        let mut flash = Flash::<512>::new(2);
        flash.cut_power(cut);
        let mut flash = Journal::open(flash).0.release();
        flash.power_up(1);
        assert_eq!(Journal::open(flash).1, Opened::Fresh, "after {after}, {cut:?}");
    }
}

#[test]
fn a_record_with_remains_behind_it_is_appended_again() {
    let mut world = World::<512>::new();
    assert_eq!(world.cycle(1, None), End::Quiet);
    assert_eq!(world.operations(0), []);
    assert_eq!(world.cycle(1, Some(torn_after(4))), End::Cut);
    assert_eq!(world.operations(0), [Operation::Program; 8]);
    world.settle();
}

/// Home is full to its last slot, its newest record is in doubt, and the other sector is not blank. No slot is left to append
/// the record again, so the other sector is erased first, and the record is moved there.
#[test]
fn what_is_in_doubt_and_finds_no_slot_is_moved() {
    use Operation::{Erase, Program};
    let mut world = World::<512>::new();
    // There is room for 21 saves. The seal of the last one is cut.
    let saves = 21;
    let seal = world.operations(saves).len() - 1;
    assert_eq!(world.cycle(saves, Some(torn_after(seal))), End::Cut);
    let mut starts = 0;
    while world.operations(0).starts_with(&[Program; 8]) {
        assert_eq!(world.cycle(0, Some(torn_after(4))), End::Cut);
        starts += 1;
    }
    assert_eq!(starts, 2, "each skips one of the four slots that are kept for starts, and fills one");
    let moved = [[Erase, Program].as_slice(), &[Program; 8], &[Erase, Program]].concat();
    assert_eq!(world.operations(0), moved);
    world.settle();
}

#[test]
fn a_spare_full_of_remains_is_not_trusted_after_an_erase_that_was_cut() {
    let world = spare_full_of_remains();
    let after = world.operations(0).iter().position(|op| *op == Operation::Erase).unwrap();
    let tears = EraseTear::ALL.into_iter().cycle().take(EraseTear::ALL.len() * 200);
    for (seed, erase) in (0..).zip(tears) {
        let mut world = world.clone();
        let cut = Cut { after, program: ProgramTear::All, erase, seed };
        assert_eq!(world.cycle(0, Some(cut)), End::Cut);
        world.settle();
    }
    let mut tally = Tally::default();
    cut_again(world, 0, 2, &mut tally);
    tally.report("a spare full of remains, then 2 cuts in a row");
}
