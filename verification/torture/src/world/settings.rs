//! The settings' storage on a flash that loses power, and what may be found in it after that (D19).

use std::cell::RefCell;
use std::rc::Rc;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use flash_model::{Cut, Error, Flash, Operation};
use motion_core::Storage;
use protocol_core::registers::Image;

use crate::violation::{Check, Violation, ensure};

/// The sectors of the reference board.
pub(super) const REAL: usize = 16_384;
/// What a power cycle has room for at least, on such sectors.
const ROOM: u32 = 600;

/// A handle to a flash that outlives what runs from it.
#[derive(Clone, Debug)]
struct Handle<const SECTOR: usize>(Rc<RefCell<Cells<SECTOR>>>);

#[derive(Debug)]
struct Cells<const SECTOR: usize> {
    flash: Flash<SECTOR>,
    /// The first thing that no driver may ask of a flash.
    misuse: Option<Error>,
}

impl<const SECTOR: usize> Handle<SECTOR> {
    fn note<T>(&self, result: Result<T, Error>) -> Result<T, Error> {
        result.inspect_err(|error| {
            if *error != Error::PowerLost {
                self.0.borrow_mut().misuse.get_or_insert(*error);
            }
        })
    }
}

impl<const SECTOR: usize> ErrorType for Handle<SECTOR> {
    type Error = Error;
}

impl<const SECTOR: usize> ReadNorFlash for Handle<SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        let result = self.0.borrow_mut().flash.read(offset, bytes);
        self.note(result)
    }

    fn capacity(&self) -> usize {
        self.0.borrow().flash.capacity()
    }
}

impl<const SECTOR: usize> NorFlash for Handle<SECTOR> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        let result = self.0.borrow_mut().flash.erase(from, to);
        self.note(result)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        let result = self.0.borrow_mut().flash.write(offset, bytes);
        self.note(result)
    }
}

/// How a start or a save ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End<T> {
    Done(T),
    /// The power was cut in the middle.
    Cut,
}

/// What a start found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Found {
    pub(super) image: Option<Image>,
    pub(super) storage: Storage,
}

/// A storage with sectors of any size.
pub(super) trait Settings: std::fmt::Debug {
    /// Starts from it; `seed` decides how half programmed cells read, and the power may be cut on the way.
    fn start(&mut self, seed: u64, cut: Option<Cut>) -> Check<End<Found>>;
    /// Saves; the power may be cut on the way.
    fn save(&mut self, image: &Image, cut: Option<Cut>) -> Check<End<Storage>>;
    /// From now on, one sector cannot be erased any more.
    fn wear_out_sector(&mut self, sector: usize);
    /// From now on, one bit cannot be programmed any more.
    fn wear_out_bit(&mut self, bit: u64);
}

/// The storage, and what is known about it.
#[derive(Debug)]
pub(super) struct Flashed<const SECTOR: usize> {
    flash: Handle<SECTOR>,
    store: Option<protocol_core::settings::Settings<Handle<SECTOR>>>,
    /// What the next start may find.
    possible: Vec<Option<Image>>,
    is_worn: bool,
    saves: u32,
}

impl<const SECTOR: usize> Flashed<SECTOR> {
    pub(super) fn new() -> Self {
        let cells = Cells { flash: Flash::new(2), misuse: None };
        let flash = Handle(Rc::new(RefCell::new(cells)));
        Self { flash, store: None, possible: vec![None], is_worn: false, saves: 0 }
    }

    fn prepare(&self, cut: Option<Cut>) {
        cut.into_iter().for_each(|cut| self.flash.0.borrow_mut().flash.cut_power(cut));
    }

    fn check_use(&self, most_erases: usize, most_programs: usize) -> Check {
        let cells = self.flash.0.borrow();
        ensure(cells.misuse.is_none(), || format!("the flash was misused: {:?}", cells.misuse))?;
        let (erases, programs) = (cells.flash.count(Operation::Erase), cells.flash.count(Operation::Program));
        ensure(self.is_worn || erases <= most_erases && programs <= most_programs, || {
            format!(
                "{erases} sectors erased and {programs} words programmed, {most_erases} and {most_programs} is most"
            )
        })
    }

    fn is_powered(&self) -> bool {
        self.flash.0.borrow().flash.is_powered()
    }

    /// What became of the storage has to have a reason.
    fn check_storage(&self, storage: Storage) -> Check {
        let early = storage == Storage::Full && SECTOR == REAL && self.saves < ROOM;
        ensure(self.is_worn || storage != Storage::Broken && !early, || {
            format!("a sound flash is {storage:?} after {} saves", self.saves)
        })
    }
}

impl<const SECTOR: usize> Settings for Flashed<SECTOR> {
    fn start(&mut self, seed: u64, cut: Option<Cut>) -> Check<End<Found>> {
        self.flash.0.borrow_mut().flash.power_up(seed);
        self.prepare(cut);
        let store = protocol_core::settings::Settings::open(self.flash.clone());
        let image = store.found().copied();
        self.check_use(2, 18)?;
        if !self.is_powered() {
            return Ok(End::Cut);
        }
        // From here to the next start an erase is a misuse.
        self.flash.0.borrow_mut().flash.forbid_erase();
        self.saves = 0;
        let storage = store.storage();
        self.store = Some(store);
        self.check_storage(storage)?;
        let possible = self.possible.contains(&image);
        ensure(possible, || format!("settings {image:?} found, and only {:?} may be", self.possible))?;
        // What could not be made firm, on a worn flash, may read otherwise at the next start: the arm says that
        // its storage is broken.
        if storage == Storage::Ready || !self.is_worn {
            self.possible = vec![image];
        }
        Ok(End::Done(Found { image, storage }))
    }

    fn save(&mut self, image: &Image, cut: Option<Cut>) -> Check<End<Storage>> {
        let before = self.flash.0.borrow().flash.history().len();
        self.prepare(cut);
        self.possible.push(Some(*image));
        let store =
            self.store.as_mut().ok_or_else(|| Violation("saved while the power is off".to_owned()))?;
        let storage = store.save(image);
        let done = self.flash.0.borrow().flash.history().len() - before;
        self.check_use(2, usize::MAX)?;
        ensure(self.is_worn || done <= 8, || format!("a save programmed {done} words"))?;
        if !self.is_powered() {
            return Ok(End::Cut);
        }
        self.saves += 1;
        // On a worn flash a save may fail, which the status block says, or find no room for another attempt;
        // what it left behind may be found or not.
        if storage == Storage::Ready || !self.is_worn {
            self.possible = vec![Some(*image)];
        }
        self.check_storage(storage)?;
        Ok(End::Done(storage))
    }

    fn wear_out_sector(&mut self, sector: usize) {
        self.is_worn = true;
        self.flash.0.borrow_mut().flash.wear_out_sector(sector);
    }

    fn wear_out_bit(&mut self, bit: u64) {
        self.is_worn = true;
        let bits = 2 * SECTOR as u64 * 8;
        let bit = usize::try_from(bit % bits).unwrap_or(0);
        self.flash.0.borrow_mut().flash.wear_out_bit(bit);
    }
}
