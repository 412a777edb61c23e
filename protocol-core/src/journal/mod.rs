//! The settings on two sectors of NOR flash. After a power cut at any instant the settings are those before or after
//! the interrupted save ([D19](crate::decisions#d19)).
//!
//! ```text
//!    home: the sector in use               spare: the other sector
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
//! A save appends the whole image as one record of eight words. When home is full, the log continues in the spare with
//! the next generation. The next start erases the old home, which becomes the spare. The rules:
//!
//! - **Only a start erases.** An erase stops the chip for up to 0.8 s, which is not allowed while the servos are on. A
//!   start that finds less than a quarter of home free moves to the spare at once. So each power cycle has room for
//!   about 1.25 sectors of records or more: over 600 saves with 16 KiB sectors.
//! - **A power cut leaves half-programmed cells.** They may read differently at each start. The seal is programmed after
//!   the other words were verified, so a sealed record was complete. A record is in doubt if it is unsealed, needed a
//!   correction, or has remains of another record behind it. A start appends such a record again before it erases
//!   anything and before it returns the settings. If home has no slot left for that, it holds the record before, too:
//!   the start erases the spare, if it is not prepared, and moves the record there.
//! - **Generation and slot give the order**, not a running number. An interrupted record and its replacement would have
//!   the same number, and the wrong one might become readable later.
//! - **Only its mark states that a sector is blank.** After an interrupted erase a sector may read as blank. The mark
//!   is programmed after a complete erase and a check of every word. It is the CRC of the generation that the sector is
//!   prepared for, so an older mark that survives an interrupted erase is not valid. One word is enough: the sector is
//!   blank before the first bit of the mark is programmed. An interrupted mark lacks zeros, and an erase adds none.
//!   Such a mark costs one more erase, and it cannot become valid if that erase is interrupted, too.
//! - **A log revokes the valid mark of the spare before it erases the spare.** Otherwise the mark might survive an
//!   interrupted erase. This happens only after many starts in a row were interrupted during the move to the spare, so
//!   that the spare is half full of remains. The revocation is a word behind home's own mark: it assigns the next
//!   generation to the spare. Without a record in either sector nothing is revoked, because there is nothing to lose.
//! - **A start skips one slot**, because a word whose programming was cut at its very beginning may read as blank. If the
//!   first record of a power cycle is cut like that, the next power cycle uses the same slot. It programs the same first
//!   word again, because a record begins with the generation of its sector.
//! - **The last four slots of a sector are reserved for starts**, so that a start can append a record when saves find no
//!   room.
//! - **A log always has a record.** The first start appends a record without settings. Otherwise an interrupted first
//!   save could appear and disappear.
//! - **A sector that is not blank after an erase is not used.** In an emulator, for example, flash does not change and
//!   reads 0.
//!
//! No word is programmed with two different values. A save programs eight words. A start erases two sectors and
//! programs 18 words at most: a record appended again, a mark, a record moved, a mark. A cell that does not take its
//! bit costs a second attempt in the next slot. A revocation after a wrong bit in the newest record costs one word more.
//! If the first sector cannot be erased, the first start tries it twice.
//! This module does not know registers: an image is 20 bytes.

mod sectors;
mod slot;

use embedded_storage::nor_flash::NorFlash;

use crate::registers::Image;
use sectors::{Sectors, SlotAddress, Survey};
use slot::Record;

/// The slots at the end of a sector that only a start may use.
const RESERVE: u32 = 4;
/// The words behind the mark of a sector, one for each revocation.
const REVOCATIONS: u32 = 7;
/// The number of slots tried for one record.
const ATTEMPTS: u32 = 2;
/// The image in a record without settings. It differs from all settings, because their reserved bytes are zero.
const NO_SETTINGS: Image = Image([0xFF; Image::LENGTH]);

/// The result of opening a journal.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Opened {
    /// Nothing was ever saved: the flash was blank, the first start was interrupted, or the log has no settings yet.
    Fresh,
    /// The settings in the newest valid record of the log.
    Found(Image),
    /// The flash was not blank, but held no valid record. It was erased and is in use as a fresh flash. A caller that wants
    /// to refuse such a flash opens a copy of it first.
    Damaged,
    /// The flash does not keep data. Settings may be readable, but nothing will be saved.
    Broken(Option<Image>),
}

impl Opened {
    /// The saved settings, if there are any.
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
    /// No slot is left before the next start, which erases.
    Full,
    /// The flash does not keep data.
    Broken,
}

/// The end of the log.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Tail {
    next: SlotAddress,
    generation: u32,
    /// The generation that the other sector is or will be prepared for.
    following: u32,
    /// The first slot to use in the spare, if the spare is prepared.
    spare: Option<u32>,
}

impl Tail {
    /// The tail before the first record.
    const BLANK: Self =
        Self { next: SlotAddress { sector: 0, slot: 1 }, generation: 1, following: 2, spare: None };

    /// Continues in the spare, which becomes home.
    fn change_over(&mut self) -> Result<(), SaveError> {
        let slot = self.spare.take().ok_or(SaveError::Full)?;
        self.next = SlotAddress { sector: self.next.sector ^ 1, slot };
        self.generation = self.following;
        self.following = slot::generation_after(self.following, 1);
        Ok(())
    }

    /// Takes the next slot below `limit`. Without one, continues in the spare and takes its first free slot.
    fn take_slot(&mut self, limit: u32) -> Result<SlotAddress, SaveError> {
        if self.next.slot >= limit {
            self.change_over()?;
        }
        let address = self.next;
        self.next.slot += 1;
        Ok(address)
    }
}

/// The log of settings on a flash of two sectors.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Journal<F> {
    sectors: Sectors<F>,
    tail: Tail,
    /// The image that the next start will find, if it is known.
    newest: Option<Image>,
    broken: bool,
}

impl<F: NorFlash> Journal<F> {
    const SLOTS: u32 = Sectors::<F>::SLOTS;
    /// Saves use the slots below this one.
    const LIMIT: u32 = Self::SLOTS - RESERVE;

    /// Finds the settings and makes room for saves. Only this function and [`Journal::reopen`] erase.
    ///
    /// The flash has two sectors of `ERASE_SIZE` (512 bytes to 1 MiB) and words of at most four bytes.
    pub fn open(flash: F) -> (Self, Opened) {
        let mut journal = Self { sectors: Sectors(flash), tail: Tail::BLANK, newest: None, broken: false };
        let opened = journal.reopen();
        (journal, opened)
    }

    /// Opens the journal again, as the next start does: [`Journal::open`] on the same flash.
    pub fn reopen(&mut self) -> Opened {
        self.tail = Tail::BLANK;
        self.newest = None;
        let opened = self.start();
        self.broken = matches!(opened, Opened::Broken(_));
        opened
    }

    /// Saves the settings. An unchanged image is not saved again. (An image of 20 times 0xFF would read as no settings;
    /// no arm has such an image.)
    ///
    /// # Errors
    /// [`SaveError::Full`] if there is no room before the next start. [`SaveError::Broken`] if the flash does not keep data:
    /// then the next start may find the settings before or after this save.
    pub fn save(&mut self, image: &Image) -> Result<(), SaveError> {
        if self.newest.as_ref() == Some(image) {
            return Ok(());
        }
        if self.broken {
            return Err(SaveError::Broken);
        }
        self.append(Self::LIMIT, image)
    }

    /// How many images can be saved before the next start.
    #[must_use]
    pub fn room(&self) -> usize {
        let free = |slot| Self::LIMIT.saturating_sub(slot) as usize;
        if self.broken { 0 } else { free(self.tail.next.slot) + self.tail.spare.map_or(0, free) }
    }

    /// The flash, for a test or a simulator that changes it.
    pub const fn flash_mut(&mut self) -> &mut F {
        &mut self.sectors.0
    }

    /// Ends the journal and returns its flash.
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

    /// Starts a log in the first sector that can be erased: appends a record without settings, and prepares the other sector.
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

    /// Continues a log: makes the newest record firm, prepares the spare, and makes room for saves.
    fn resume(&mut self, home: &Survey, other: &Survey, newest: Record) -> Result<(), SaveError> {
        let next = SlotAddress { sector: home.sector, slot: home.end + 1 };
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

    /// The first slot to use in a spare that is prepared for a generation.
    ///
    /// The spare may hold the remains of interrupted records. This happens when home is full, so the next step is a move,
    /// which appends the newest record behind the remains. An erase would not be safer: an interrupted erase may leave the
    /// valid mark and damage the rest.
    fn first_free(spare: &Survey, generation: u32) -> Option<u32> {
        (spare.waits_for(generation) && spare.end <= Self::SLOTS / 2).then_some(spare.end)
    }

    /// Erases a sector and prepares it for a generation. Returns its first slot to use; `None` if the flash refused.
    fn prepare(&mut self, sector: u32, generation: u32) -> Option<u32> {
        self.sectors.prepare(sector, generation).ok()?;
        Some(1)
    }

    fn firm_up(&mut self, image: &Image) -> Result<(), SaveError> {
        match self.append(Self::SLOTS, image) {
            // Many starts in a row were interrupted here, until home was full. Then home holds the previous record,
            // too, and an erase of the other sector loses nothing.
            Err(SaveError::Full) => Ok(()),
            result => result,
        }
    }

    /// Revokes the valid mark of a sector before the sector is erased.
    ///
    /// An existing revocation is programmed again, because an earlier start may have been interrupted in it. If there is no
    /// word left, or its cells are worn out, the sector is erased without a revocation.
    fn revoke(&mut self, home: &Survey, other: &Survey) {
        let Tail { following, .. } = &mut self.tail;
        let is_valid = other.mark == slot::mark(*following);
        let count = home.revoked + u32::from(is_valid);
        if (1..=REVOCATIONS).contains(&count) {
            *following = slot::generation_after(*following, is_valid.into());
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
            let address = self.tail.take_slot(limit)?;
            self.newest = None;
            if self.sectors.append(address, self.tail.generation, image).is_ok() {
                self.newest = Some(*image);
                return Ok(());
            }
        }
        Err(SaveError::Broken)
    }
}
