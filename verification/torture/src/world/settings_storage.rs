//! The settings on a flash with power cuts, and a check of the settings that a start finds (D19).

use std::cell::RefCell;
use std::rc::Rc;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use flash_model::{Cut, Error, Flash, Operation};
use protocol_core::registers::Image;
use protocol_core::settings::{Settings, Storage};

use crate::violation::{Check, Violation, ensure};

/// Bytes of a sector of the reference board.
pub(super) const BOARD_SECTOR: usize = 16_384;
/// Two sectors of [`BOARD_SECTOR`] bytes have room for at least this many saves between two starts (D19).
const MIN_SAVES: u32 = 600;

/// A flash that outlives the controller.
#[derive(Clone, Debug)]
struct SharedFlash<const SECTOR: usize>(Rc<RefCell<FlashState<SECTOR>>>);

#[derive(Debug)]
struct FlashState<const SECTOR: usize> {
    flash: Flash<SECTOR>,
    /// The first operation that violated the contract of the flash.
    misuse: Option<Error>,
}

impl<const SECTOR: usize> SharedFlash<SECTOR> {
    fn record_misuse<T>(&self, result: Result<T, Error>) -> Result<T, Error> {
        result.inspect_err(|error| {
            if *error != Error::PowerLost {
                self.0.borrow_mut().misuse.get_or_insert(*error);
            }
        })
    }
}

impl<const SECTOR: usize> ErrorType for SharedFlash<SECTOR> {
    type Error = Error;
}

impl<const SECTOR: usize> ReadNorFlash for SharedFlash<SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        let result = self.0.borrow_mut().flash.read(offset, bytes);
        self.record_misuse(result)
    }

    fn capacity(&self) -> usize {
        self.0.borrow().flash.capacity()
    }
}

impl<const SECTOR: usize> NorFlash for SharedFlash<SECTOR> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        let result = self.0.borrow_mut().flash.erase(from, to);
        self.record_misuse(result)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        let result = self.0.borrow_mut().flash.write(offset, bytes);
        self.record_misuse(result)
    }
}

/// The result of a start or a save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PowerOutcome<T> {
    Completed(T),
    /// The power was cut before the end.
    Cut,
}

/// The settings at a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct StoredSettings {
    pub(super) image: Option<Image>,
    pub(super) storage: Storage,
}

/// A settings storage with sectors of any size.
pub(super) trait SettingsStorage: std::fmt::Debug {
    /// Powers up and reads the settings, with an optional power cut. `seed` decides the values of marginal bits.
    fn start(&mut self, seed: u64, cut: Option<Cut>) -> Check<PowerOutcome<StoredSettings>>;
    /// Saves settings, with an optional power cut.
    fn save(&mut self, image: &Image, cut: Option<Cut>) -> Check<PowerOutcome<Storage>>;
    /// Makes a sector unerasable.
    fn wear_out_sector(&mut self, sector: usize);
    /// Makes a bit unprogrammable.
    fn wear_out_bit(&mut self, bit: u64);
}

/// A storage with sectors of `SECTOR` bytes, and its permitted contents.
#[derive(Debug)]
pub(super) struct FlashSettings<const SECTOR: usize> {
    flash: SharedFlash<SECTOR>,
    settings: Option<Settings<SharedFlash<SECTOR>>>,
    /// The settings that the next start may find.
    allowed: Vec<Option<Image>>,
    is_worn: bool,
    saves: u32,
}

impl<const SECTOR: usize> FlashSettings<SECTOR> {
    pub(super) fn new() -> Self {
        let state = FlashState { flash: Flash::new(2), misuse: None };
        let flash = SharedFlash(Rc::new(RefCell::new(state)));
        Self { flash, settings: None, allowed: vec![None], is_worn: false, saves: 0 }
    }

    fn plan_cut(&self, cut: Option<Cut>) {
        cut.into_iter().for_each(|cut| self.flash.0.borrow_mut().flash.cut_power(cut));
    }

    fn check_use(&self, max_erases: usize, max_programs: usize) -> Check {
        let state = self.flash.0.borrow();
        ensure(state.misuse.is_none(), || format!("the flash was misused: {:?}", state.misuse))?;
        let (erases, programs) = (state.flash.count(Operation::Erase), state.flash.count(Operation::Program));
        ensure(self.is_worn || erases <= max_erases && programs <= max_programs, || {
            format!(
                "{erases} sectors erased and {programs} words programmed, more than {max_erases} and {max_programs}"
            )
        })
    }

    fn is_powered(&self) -> bool {
        self.flash.0.borrow().flash.is_powered()
    }

    /// Checks that the storage on a flash without wear is not broken, and that the sectors of the board are not full before
    /// [`MIN_SAVES`] saves.
    fn check_storage(&self, storage: Storage) -> Check {
        let early = storage == Storage::Full && SECTOR == BOARD_SECTOR && self.saves < MIN_SAVES;
        ensure(self.is_worn || storage != Storage::Broken && !early, || {
            format!("the storage of a good flash is {storage:?} after {} saves", self.saves)
        })
    }
}

impl<const SECTOR: usize> SettingsStorage for FlashSettings<SECTOR> {
    fn start(&mut self, seed: u64, cut: Option<Cut>) -> Check<PowerOutcome<StoredSettings>> {
        self.flash.0.borrow_mut().flash.power_up(seed);
        self.plan_cut(cut);
        let settings = Settings::open(self.flash.clone());
        let image = settings.found().copied();
        self.check_use(2, 18)?;
        if !self.is_powered() {
            return Ok(PowerOutcome::Cut);
        }
        // From here to the next start, the journal must not erase.
        self.flash.0.borrow_mut().flash.forbid_erase();
        self.saves = 0;
        let storage = settings.storage();
        self.settings = Some(settings);
        self.check_storage(storage)?;
        let allowed = self.allowed.contains(&image);
        ensure(allowed, || format!("the start found settings {image:?}, allowed are {:?}", self.allowed))?;
        // On a worn flash, bits may stay marginal and read differently at the next start. The storage is then broken.
        if storage == Storage::Ready || !self.is_worn {
            self.allowed = vec![image];
        }
        Ok(PowerOutcome::Completed(StoredSettings { image, storage }))
    }

    fn save(&mut self, image: &Image, cut: Option<Cut>) -> Check<PowerOutcome<Storage>> {
        let before = self.flash.0.borrow().flash.history().len();
        self.plan_cut(cut);
        self.allowed.push(Some(*image));
        let settings = self.settings.as_mut();
        let settings = settings.ok_or_else(|| Violation("a save while the power is off".to_owned()))?;
        let storage = settings.save(image);
        let done = self.flash.0.borrow().flash.history().len() - before;
        self.check_use(2, usize::MAX)?;
        ensure(self.is_worn || done <= 8, || format!("a save programmed {done} words"))?;
        if !self.is_powered() {
            return Ok(PowerOutcome::Cut);
        }
        self.saves += 1;
        // On a worn flash a save may fail, or find no room for another attempt. The next start may find its settings or not.
        if storage == Storage::Ready || !self.is_worn {
            self.allowed = vec![Some(*image)];
        }
        self.check_storage(storage)?;
        Ok(PowerOutcome::Completed(storage))
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
