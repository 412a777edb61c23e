//! An arm's settings over many power cycles, and what must hold in every one of them (D19):
//!
//! - a start finds the image of the last acknowledged save, or of a save attempted since;
//! - all later starts find the same, until another save is acknowledged or attempted;
//! - a save is refused only if [`Journal::room`] was 0;
//! - only a start erases: it erases two sectors and programs 18 words at most; a save programs eight.
#![allow(dead_code)] // Each test program uses its part.

use std::cell::RefCell;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use flash_model::{Cut, EraseTear, Error, Flash, Operation, ProgramTear, Random};
use protocol_core::journal::{Journal, Opened, SaveError};
use protocol_core::registers::Image;

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Bytes of a sector of the reference board.
pub const REAL: usize = 16_384;

/// The journal's access to a flash that the test inspects, too.
#[derive(Debug)]
pub struct Access<'a, const SECTOR: usize>(pub &'a RefCell<Flash<SECTOR>>);

impl<const SECTOR: usize> ErrorType for Access<'_, SECTOR> {
    type Error = Error;
}

impl<const SECTOR: usize> ReadNorFlash for Access<'_, SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.0.borrow_mut().read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.borrow().capacity()
    }
}

impl<const SECTOR: usize> NorFlash for Access<'_, SECTOR> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        self.0.borrow_mut().erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.borrow_mut().write(offset, bytes)
    }
}

/// The image with this number: random bytes, so that it differs from the images with other numbers.
#[must_use]
pub fn image(number: u64) -> Image {
    let mut random = Random::new(number);
    Image(std::array::from_fn(|_| random.next().to_le_bytes()[0]))
}

/// How a power cycle ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The power was switched off when all was done.
    Quiet,
    /// The power was cut during the cycle.
    Cut,
}

/// A flash, and what may be found on it.
#[derive(Clone, Debug)]
pub struct World<const SECTOR: usize> {
    pub flash: RefCell<Flash<SECTOR>>,
    /// The settings that the next start may find.
    possible: Vec<Option<Image>>,
    /// How many saves were tried: the number of the last image.
    pub images: u64,
    /// Decides how marginal bits read.
    pub seed: u64,
    /// The largest number of erased sectors and of programmed words in one start.
    pub most: (usize, usize),
    /// The power cycles since the last [`World::forget_past`] that cleared them, for the report of a failure.
    past: Vec<(usize, Option<Cut>)>,
}

impl<const SECTOR: usize> Drop for World<SECTOR> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("saves and cuts of the power cycles that led here: {:?}", self.past);
        }
    }
}

impl<const SECTOR: usize> World<SECTOR> {
    #[must_use]
    pub fn new() -> Self {
        Self::of(Flash::new(2), None)
    }

    /// A flash that holds nothing but one record.
    #[must_use]
    pub fn holding(generation: u32, image: Image) -> Self {
        let mut record = [generation.to_le_bytes().as_slice(), &image.0].concat();
        record.extend(CRC.checksum(&record).to_le_bytes());
        record.extend([0x5E, 0xA1, 0xC3, 0x96]);
        let mut bytes = vec![0xFF; 2 * SECTOR];
        bytes[32..64].copy_from_slice(&record);
        Self::of(Flash::holding(&bytes), Some(image))
    }

    fn of(flash: Flash<SECTOR>, settings: Option<Image>) -> Self {
        let (flash, possible) = (RefCell::new(flash), vec![settings]);
        Self { flash, possible, images: 0, seed: 0, most: (0, 0), past: Vec::new() }
    }

    /// The settings that the next start finds. Panics if there are several possibilities.
    #[must_use]
    pub fn settings(&self) -> Option<Image> {
        assert_eq!(self.possible.len(), 1);
        self.possible[0]
    }

    /// Runs a power cycle: a start and `saves` saves, each with its checks. The power is cut as `cut` says.
    pub fn cycle(&mut self, saves: usize, cut: Option<Cut>) -> End {
        self.past.push((saves, cut));
        self.seed = Random::new(self.seed).next();
        self.flash.get_mut().power_up(self.seed);
        if let Some(cut) = cut {
            self.flash.get_mut().cut_power(cut);
        }
        let (mut journal, opened) = Journal::open(Access(&self.flash));
        self.flash.borrow_mut().forbid_erase();
        self.most = check_start(&self.flash.borrow(), self.most);
        if !self.flash.borrow().is_powered() {
            return End::Cut;
        }
        found(&mut self.possible, opened);
        for _ in 0..saves {
            self.images += 1;
            if save(&self.flash, &mut self.possible, &mut journal, image(self.images)) == End::Cut {
                return End::Cut;
            }
        }
        End::Quiet
    }

    /// Forgets the past power cycles if the last one was quiet: only later cycles can explain a failure.
    pub fn forget_past(&mut self, end: End) {
        if end == End::Quiet {
            self.past.clear();
        }
    }

    /// What a power cycle would do to the flash, operation by operation.
    #[must_use]
    pub fn operations(&self, saves: usize) -> Vec<Operation> {
        let mut world = self.clone();
        assert_eq!(world.cycle(saves, None), End::Quiet);
        let flash = world.flash.borrow();
        flash.history().to_vec()
    }

    /// Runs some quiet power cycles, with their checks.
    pub fn settle(&mut self) {
        for saves in [0, 1, 0] {
            assert_eq!(self.cycle(saves, None), End::Quiet);
        }
    }
}

fn check_start<const SECTOR: usize>(flash: &Flash<SECTOR>, most: (usize, usize)) -> (usize, usize) {
    let (erases, programs) = (flash.count(Operation::Erase), flash.count(Operation::Program));
    assert!(erases <= 2 && programs <= 18, "a start erased {erases} sectors and programmed {programs} words");
    (most.0.max(erases), most.1.max(programs))
}

/// Checks what a start found. From now on all starts have to find the same.
fn found(possible: &mut Vec<Option<Image>>, opened: Opened) {
    let settings = opened.image().copied();
    match opened {
        Opened::Found(_) | Opened::Fresh => {}
        // A first start that was cut can leave anything.
        Opened::Damaged if possible == &[None] => {}
        _ => panic!("found {opened:?}, possible was {possible:?}"),
    }
    assert!(possible.contains(&settings), "found {settings:?}, possible was {possible:?}");
    *possible = vec![settings];
}

fn save<const SECTOR: usize>(
    flash: &RefCell<Flash<SECTOR>>,
    possible: &mut Vec<Option<Image>>,
    journal: &mut Journal<Access<'_, SECTOR>>,
    image: Image,
) -> End {
    let (room, before) = (journal.room(), flash.borrow().history().len());
    possible.push(Some(image));
    let result = journal.save(&image);
    let programs = flash.borrow().history().len() - before;
    assert!(programs <= 8, "a save programmed {programs} words");
    match result {
        _ if !flash.borrow().is_powered() => return End::Cut,
        Ok(()) => {
            assert_eq!((journal.room() + 1, programs), (room, 8));
            *possible = vec![Some(image)];
        }
        Err(SaveError::Full) => {
            assert_eq!((room, programs), (0, 0));
            possible.pop();
        }
        Err(SaveError::Broken) => panic!("a sound flash was called broken"),
    }
    End::Quiet
}

/// Every way to cut one operation.
pub fn cuts(after: usize, operation: Operation, seed: u64) -> impl Iterator<Item = Cut> {
    let base = Cut { after, program: ProgramTear::All, erase: EraseTear::All, seed };
    let programs = ProgramTear::ALL.into_iter().filter(move |_| operation == Operation::Program);
    let erases = EraseTear::ALL.into_iter().filter(move |_| operation == Operation::Erase);
    let programs = programs.map(move |program| Cut { program, ..base });
    programs.chain(erases.map(move |erase| Cut { erase, ..base }))
}

/// Cuts a power cycle with `saves` saves at each operation from number `from` on, in every way. Returns the world after each cut.
pub fn every_cut<const SECTOR: usize>(
    world: &World<SECTOR>,
    saves: usize,
    from: usize,
) -> impl Iterator<Item = World<SECTOR>> + '_ {
    let operations = world.operations(saves).into_iter().enumerate().skip(from);
    let cuts = operations.flat_map(|(after, operation)| cuts(after, operation, world.seed ^ after as u64));
    cuts.enumerate().map(move |(number, cut)| {
        let mut world = world.clone();
        assert_eq!(world.cycle(saves, Some(cut)), End::Cut, "{cut:?}");
        world.seed ^= number as u64;
        world
    })
}

/// Prints what was tried, as a row of the table that `cargo xtask torture` prints. The last column, the failures, is always
/// `nothing`: a failure panics before this call.
pub fn report(tried: &str, many: &str) {
    println!("\njournal, {tried}\t{many}\tnothing");
}
