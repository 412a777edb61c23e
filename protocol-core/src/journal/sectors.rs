//! Two sectors of slots: reading them over, filling a slot, making a sector blank.
//!
//! Checks everything it does by reading it back, and never erases or programs on its own account. Knows
//! nothing of which record counts.

use embedded_storage::nor_flash::NorFlash;

use super::slot::{self, BLANK, Record, Slot, Word};
use crate::registers::Image;

/// The flash did not do, or did not keep, what it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Refused;

/// Where a slot is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// 0 or 1.
    pub(super) sector: u32,
    /// From 1 on; 0 is the sector's mark.
    pub(super) slot: u32,
}

/// What a sector holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Survey {
    pub(super) sector: u32,
    pub(super) mark: Word,
    /// How many words stand behind the mark: as many marks of the other sector do not count any more.
    pub(super) revoked: u32,
    /// The first slot with nothing but blank ones from there on.
    pub(super) end: u32,
    /// The last record; firm only if nothing was begun behind it.
    pub(super) newest: Option<Record>,
}

impl Survey {
    /// Does this sector hold the newer record?
    pub(super) fn is_later_than(&self, other: &Self) -> bool {
        let is_later = |mine: Record| other.newest.is_none_or(|theirs| mine.is_later_than(&theirs));
        self.newest.is_some_and(is_later)
    }

    /// Was this sector found blank when it was marked for `generation`, and holds no record yet? It may hold
    /// the remains of one that was cut.
    pub(super) fn waits_for(&self, generation: u32) -> bool {
        self.mark == slot::mark(generation) && self.newest.is_none()
    }

    /// Was nothing ever saved here, or was the very first start cut?
    pub(super) fn was_never_used(&self, other: &Self) -> bool {
        let is_blank = |sector: &Self| sector.end == 1 && sector.mark == BLANK[0];
        let is_first = |sector: &Self| sector.waits_for(1);
        is_first(self) || is_first(other) || is_blank(self) && is_blank(other)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Sectors<F>(pub(super) F);

impl<F: NorFlash> Sectors<F> {
    /// Slots of a sector, with slot 0.
    pub(super) const SLOTS: u32 = {
        assert!(F::ERASE_SIZE.is_multiple_of(32) && F::ERASE_SIZE >= 512 && F::ERASE_SIZE <= 1 << 20);
        assert!(4_usize.is_multiple_of(F::WRITE_SIZE) && 4_usize.is_multiple_of(F::READ_SIZE));
        #[expect(clippy::cast_possible_truncation, reason = "asserted two lines above")]
        let bytes = F::ERASE_SIZE as u32;
        bytes / slot::LENGTH
    };

    fn address(place: Place) -> u32 {
        (place.sector * Self::SLOTS + place.slot) * slot::LENGTH
    }

    fn read(&mut self, place: Place) -> Result<Slot, Refused> {
        let mut slot = BLANK;
        self.0.read(Self::address(place), slot.as_flattened_mut()).map_err(|_| Refused)?;
        Ok(slot)
    }

    /// Reads a sector from its end, until it meets a record.
    pub(super) fn survey(&mut self, sector: u32) -> Result<Survey, Refused> {
        let [mark, behind @ ..] = self.read(Place { sector, slot: 0 })?;
        let revoked = behind.iter().fold(0, |count, word| count + u32::from(*word != BLANK[0]));
        let mut survey = Survey { sector, mark, revoked, end: 1, newest: None };
        for slot in (1..Self::SLOTS).rev() {
            let content = self.read(Place { sector, slot })?;
            if content == BLANK {
                continue;
            }
            survey.end = survey.end.max(slot + 1);
            if let Some(record) = slot::decode(&content) {
                let firm = record.firm && survey.end == slot + 1;
                survey.newest = Some(Record { firm, ..record });
                break;
            }
        }
        Ok(survey)
    }

    /// Programs words one by one in ascending order, then reads all of them back.
    fn program(&mut self, address: u32, words: &[Word]) -> Result<(), Refused> {
        let mut to = address;
        for word in words {
            self.0.write(to, word).map_err(|_| Refused)?;
            to += 4;
        }
        let mut from = address;
        for word in words {
            let mut kept = [0; 4];
            self.0.read(from, &mut kept).map_err(|_| Refused)?;
            if kept != *word {
                return Err(Refused);
            }
            from += 4;
        }
        Ok(())
    }

    /// Fills a blank slot with a record: eight words, the seal only when the others are as they should be.
    pub(super) fn append(&mut self, place: Place, generation: u32, image: &Image) -> Result<(), Refused> {
        let [body @ .., seal] = slot::encode(generation, image);
        let address = Self::address(place);
        self.program(address, &body)?;
        self.program(address + slot::LENGTH - 4, &[seal])
    }

    /// Erases a sector, makes sure that it is blank, and marks it for `generation`: one word.
    pub(super) fn prepare(&mut self, sector: u32, generation: u32) -> Result<(), Refused> {
        let start = Self::address(Place { sector, slot: 0 });
        let end = start + Self::SLOTS * slot::LENGTH;
        self.0.erase(start, end).map_err(|_| Refused)?;
        for slot in 0..Self::SLOTS {
            if self.read(Place { sector, slot })? != BLANK {
                return Err(Refused);
            }
        }
        self.program(start, &[slot::mark(generation)])
    }

    /// Notes in `sector` that the other one waits for `generation` now: the `count`-th time that it has to.
    pub(super) fn revoke(&mut self, sector: u32, count: u32, generation: u32) -> Result<(), Refused> {
        let at = Self::address(Place { sector, slot: 0 }) + 4 * count;
        self.program(at, &[slot::mark(generation)])
    }
}
