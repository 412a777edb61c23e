//! The settings on two sectors of NOR flash: after a power cut at any instant they are what they were before
//! or after the save that was cut (D19), never anything else.
//!
//! ```text
//!    one sector is home                    the other is spare
//!   ┌───────────────────────────┐         ┌───────────────────────────┐
//! 0 │ mark of generation 7      │       0 │ mark of generation 8      │
//! 1 │ record                    │       1 │ (blank)                   │
//! 2 │ record                    │         │                           │
//!   │ remains of a cut record   │         │                           │
//!   │ (blank: skipped at start) │         │                           │
//!   │ record ◀── the settings   │         │                           │
//!   │ (blank)                   │         │                           │
//!   ├───────────────────────────┤         ├───────────────────────────┤
//!   │ last four: starts only    │         │                           │
//!   └───────────────────────────┘         └───────────────────────────┘
//! ```
//!
//! A save appends the whole image as one record of eight words. When home is full the log goes on in the
//! spare, one generation higher; the next start makes the old home blank, and it is the spare. Why so:
//!
//! - **Erased at start only.** An erase stops the chip for up to 0.8 s: not while the servos are on. So a
//!   start that finds less than a quarter of home free moves to the spare at once, and a power cycle has
//!   room for a quarter and a whole sector at least: over 600 saves with 16 KiB sectors.
//! - **Half programmed cells** are what a cut leaves: they may read one way at this start and another way
//!   at the next. The seal is programmed after the rest was read back, so what is sealed was whole. A
//!   record that is unsealed, or needed a correction, or has remains of another behind it, is the newest
//!   today and perhaps not tomorrow. It is *appended again before anything is erased*, and before anybody
//!   is told.
//! - **Order is by generation and place**, not by a running number: the remains of a record and the one
//!   written in its stead would share a number, and the wrong one might win when it reads whole one day.
//! - **A sector is blank because its mark says so**, not because it looks blank: after a cut erase it may
//!   look so. The mark is programmed after a whole erase and a check of every word. It names the generation
//!   it waits for, so the mark of an earlier life that outlived a cut erase does not count. One word is
//!   enough. What it says was true before its first bit was programmed; and a mark that was cut and reads
//!   wrong lacks zeros, which no erase gives it: it costs an erase, and does not come to read right if that
//!   is cut, too.
//! - **A mark that is right is revoked before its sector is erased**, or it might outlive an erase that was
//!   cut, and promise what is not so. It comes to this when start after start is cut while it moves to the
//!   spare, until that is half full of remains. A word behind home's own mark then says that the spare waits
//!   for one generation more.
//! - **One slot is skipped after a start**, since a word that was cut at its very beginning may not show.
//!   (The first record of a power cycle, cut like that, is begun again in the same place by the next one. A
//!   record begins with its sector's generation, so it is the same word that is programmed again, and made
//!   whole.)
//! - **The last four slots of a sector are for starts**: a record can be made firm where saves find no
//!   room.
//! - **A log always has a record.** The first start appends one that says there are no settings. Else the
//!   first save of all, if it was cut, could come and go.
//! - **Not every flash does as it is told.** A sector that is not blank after an erase is not used: in an
//!   emulator nothing changes, and all of it reads 0.
//!
//! No word is programmed with one value and then another. A save programs eight words. A start erases two
//! sectors and programs 18 words at most: a record made firm, a mark, a record moved, a mark. Only a cell
//! that does not take its bit costs more: a second attempt, in the next slot. Knows no register: an image
//! is 20 bytes.

mod sectors;
mod slot;

use embedded_storage::nor_flash::NorFlash;

use crate::registers::Image;
use sectors::{Place, Sectors, Survey};
use slot::Record;

/// The slots at a sector's end that only a start may fill.
const RESERVE: u32 = 4;
/// The words behind a sector's mark.
const REVOCATIONS: u32 = 7;
/// How many slots are tried for one record.
const ATTEMPTS: u32 = 2;
/// What the record of an arm without settings holds. No arm's settings look like this: some of their bytes
/// are reserved, and zero.
const NO_SETTINGS: Image = Image([0xFF; Image::LENGTH]);

/// What a start found.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Opened {
    /// Nothing was ever saved: the flash was blank, or the first start was cut.
    Fresh,
    /// The settings.
    Found(Image),
    /// No record was left, though something was there. It was erased, and is in use as if it had been fresh:
    /// who would rather refuse such a flash opens a copy of it first.
    Damaged,
    /// The flash does not keep what it is given: settings can be read at best, and nothing will be saved.
    Broken(Option<Image>),
}

impl Opened {
    /// The settings that were found.
    #[must_use]
    pub const fn image(&self) -> Option<&Image> {
        match self {
            Self::Found(image) => Some(image),
            Self::Broken(image) => image.as_ref(),
            Self::Fresh | Self::Damaged => None,
        }
    }
}

/// Why an image was not saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SaveError {
    /// There is no slot left that can be had without an erase: not before the next start.
    Full,
    /// The flash does not keep what it is given.
    Broken,
}

/// Where the log goes on.
#[derive(Clone, Copy, Debug)]
struct Tail {
    next: Place,
    generation: u32,
    /// The generation that the other sector waits for, or will.
    following: u32,
    /// The first slot to use in the other sector, if that is blank from there on.
    spare: Option<u32>,
}

impl Tail {
    /// Goes on in the spare.
    fn change_over(&mut self) -> Result<(), SaveError> {
        let slot = self.spare.take().ok_or(SaveError::Full)?;
        self.next = Place { sector: self.next.sector ^ 1, slot };
        self.generation = self.following;
        self.following = slot::generation_after(self.following, 1);
        Ok(())
    }

    /// Takes the next slot below `limit`, or the spare's first.
    fn take_place(&mut self, limit: u32) -> Result<Place, SaveError> {
        if self.next.slot >= limit {
            self.change_over()?;
        }
        let place = self.next;
        self.next.slot += 1;
        Ok(place)
    }
}

/// The settings' log on a flash of two sectors.
#[derive(Clone, Debug)]
pub struct Journal<F> {
    sectors: Sectors<F>,
    tail: Tail,
    /// What the next start will find, where that is known.
    newest: Option<Image>,
    broken: bool,
}

impl<F: NorFlash> Journal<F> {
    const SLOTS: u32 = Sectors::<F>::SLOTS;
    /// Saves fill the slots below this one.
    const LIMIT: u32 = Self::SLOTS - RESERVE;

    /// Finds the settings, and makes room for saves: the only place that erases.
    ///
    /// The flash has two sectors of `ERASE_SIZE` (512 bytes to 1 MiB) and words of at most four bytes.
    pub fn open(flash: F) -> (Self, Opened) {
        let tail = Tail { next: Place { sector: 0, slot: 1 }, generation: 1, following: 2, spare: None };
        let mut journal = Self { sectors: Sectors(flash), tail, newest: None, broken: false };
        let opened = journal.start();
        journal.broken = matches!(opened, Opened::Broken(_));
        (journal, opened)
    }

    /// Saves the settings. What is already there is not saved again. (20 times 0xFF would be found as no
    /// settings; no arm has such an image.)
    ///
    /// # Errors
    /// [`SaveError::Full`]: not before the next start. After [`SaveError::Broken`] the next start may find
    /// the settings before or after this save.
    pub fn save(&mut self, image: &Image) -> Result<(), SaveError> {
        if self.newest.as_ref() == Some(image) {
            return Ok(());
        }
        if self.broken {
            return Err(SaveError::Broken);
        }
        self.append(Self::LIMIT, image)
    }

    /// How many different images can be saved before the next start.
    #[must_use]
    pub fn room(&self) -> usize {
        let free = |slot| Self::LIMIT.saturating_sub(slot) as usize;
        if self.broken { 0 } else { free(self.tail.next.slot) + self.tail.spare.map_or(0, free) }
    }

    /// The flash.
    pub fn release(self) -> F {
        self.sectors.0
    }

    fn start(&mut self) -> Opened {
        let (Ok(first), Ok(second)) = (self.sectors.survey(0), self.sectors.survey(1)) else {
            return Opened::Broken(None);
        };
        let (home, other) = if second.is_later_than(&first) { (second, first) } else { (first, second) };
        let (newest, done) = match home.newest {
            Some(newest) => (newest.image, self.resume(&home, &other, newest)),
            None => (NO_SETTINGS, self.begin()),
        };
        let fresh = home.newest.is_some() || home.was_never_used(&other);
        let image = (newest != NO_SETTINGS).then_some(newest);
        match (done, image) {
            (Err(_), image) => Opened::Broken(image),
            (Ok(()), Some(image)) => Opened::Found(image),
            (Ok(()), None) if fresh => Opened::Fresh,
            (Ok(()), None) => Opened::Damaged,
        }
    }

    /// Starts a log in the first sector that gets blank.
    fn begin(&mut self) -> Result<(), SaveError> {
        let generation = self.tail.generation;
        if self.prepare(0, generation).is_none() {
            self.tail.next.sector = 1;
            self.prepare(1, generation).ok_or(SaveError::Broken)?;
        }
        self.append(Self::SLOTS, &NO_SETTINGS)?;
        self.prepare_spare();
        Ok(())
    }

    /// Goes on with a log: its newest record made firm, its other sector blank, and room for saves.
    fn resume(&mut self, home: &Survey, other: &Survey, newest: Record) -> Result<(), SaveError> {
        let next = Place { sector: home.sector, slot: home.end + 1 };
        let following = slot::generation_after(newest.generation, 1 + home.revoked);
        let spare = Self::first_free(other, following);
        self.tail = Tail { next, generation: newest.generation, following, spare };
        if !newest.firm {
            self.firm_up(&newest.image)?;
        }
        if spare.is_none() {
            self.revoke(home, other);
        }
        self.prepare_spare();
        if Self::LIMIT.saturating_sub(self.tail.next.slot) < Self::SLOTS / 4 {
            self.move_to_spare(&newest.image)?;
        }
        self.newest = Some(newest.image);
        Ok(())
    }

    /// The first slot to use in a spare that waits for a generation.
    ///
    /// It may hold the remains of records that were cut. That happens when home is full, so what comes next
    /// is a move, which appends the newest record behind them. An erase would be no better: if that is cut,
    /// it may leave the right mark, and little else.
    fn first_free(spare: &Survey, generation: u32) -> Option<u32> {
        (spare.waits_for(generation) && spare.end <= Self::SLOTS / 2).then_some(spare.end)
    }

    /// Makes a sector blank; its first slot to use.
    fn prepare(&mut self, sector: u32, generation: u32) -> Option<u32> {
        self.sectors.prepare(sector, generation).ok()?;
        Some(1)
    }

    fn firm_up(&mut self, image: &Image) -> Result<(), SaveError> {
        match self.append(Self::SLOTS, image) {
            // Start after start was cut at this, until home was full. Then the record before the newest is
            // in home as well, and an erase of the other sector can do no harm.
            Err(SaveError::Full) => Ok(()),
            result => result,
        }
    }

    /// Before a sector with the right mark is erased, another is made the right one.
    ///
    /// A note that is there already is programmed again: the cut of an earlier start may have left it half
    /// done. If there is no place for one more, or its cells are worn out, the erase has to do without.
    fn revoke(&mut self, home: &Survey, other: &Survey) {
        let Tail { following, .. } = &mut self.tail;
        let is_right = other.mark == slot::mark(*following);
        let count = home.revoked + u32::from(is_right);
        if (1..=REVOCATIONS).contains(&count) {
            *following = slot::generation_after(*following, is_right.into());
            let _ = self.sectors.revoke(home.sector, count, *following);
        }
    }

    fn prepare_spare(&mut self) {
        let Tail { next, following, spare, .. } = self.tail;
        let prepare = || self.prepare(next.sector ^ 1, following);
        self.tail.spare = spare.or_else(prepare);
    }

    fn move_to_spare(&mut self, image: &Image) -> Result<(), SaveError> {
        if self.tail.change_over().is_ok() {
            self.append(Self::SLOTS, image)?;
            self.prepare_spare();
        }
        Ok(())
    }

    fn append(&mut self, limit: u32, image: &Image) -> Result<(), SaveError> {
        for _ in 0..ATTEMPTS {
            let place = self.tail.take_place(limit)?;
            self.newest = None;
            if self.sectors.append(place, self.tail.generation, image).is_ok() {
                self.newest = Some(*image);
                return Ok(());
            }
        }
        Err(SaveError::Broken)
    }
}
