//! Two sectors of slots: survey a sector, append a record, prepare a blank sector.
//!
//! Every program and erase operation is verified by reading back. The journal decides when to erase and program, and which
//! record counts.

use embedded_storage::nor_flash::NorFlash;

use super::slot::{self, BLANK, Record, Slot, Word};
use crate::registers::Image;

/// The flash refused an operation, or the verification failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FlashRefused;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct SlotAddress {
    /// 0 or 1.
    pub(super) sector: u32,
    /// Records begin at slot 1; slot 0 holds the mark of the sector.
    pub(super) slot: u32,
}

/// The content of a sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Survey {
    pub(super) sector: u32,
    pub(super) mark: Word,
    /// Number of revocations behind the mark. Each makes one mark of the other sector invalid.
    pub(super) revoked: u32,
    /// The first slot of the blank rest of the sector.
    pub(super) end: u32,
    /// The last valid record. It is firm only if no slot behind it was begun.
    pub(super) newest: Option<Record>,
}

impl Survey {
    /// Does this sector hold a newer record than the other sector?
    pub(super) fn is_later_than(&self, other: &Self) -> bool {
        let is_later = |mine: Record| other.newest.is_none_or(|theirs| mine.is_later_than(&theirs));
        self.newest.is_some_and(is_later)
    }

    /// Is this sector prepared for `generation` and still without a valid record? It may hold the remains of an interrupted
    /// record.
    pub(super) fn waits_for(&self, generation: u32) -> bool {
        self.mark == slot::mark(generation) && self.newest.is_none()
    }

    /// Are both sectors blank, or is one prepared for generation 1 and without a record? Then nothing was ever saved.
    pub(super) fn was_never_used(&self, other: &Self) -> bool {
        let is_blank = |sector: &Self| sector.end == 1 && sector.mark == BLANK[0];
        let is_first = |sector: &Self| sector.waits_for(1);
        is_first(self) || is_first(other) || is_blank(self) && is_blank(other)
    }
}

#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Sectors<F>(pub(super) F);

impl<F: NorFlash> Sectors<F> {
    /// Number of slots in a sector, including slot 0.
    pub(super) const SLOTS: u32 = {
        assert!(F::ERASE_SIZE.is_multiple_of(32) && F::ERASE_SIZE >= 512 && F::ERASE_SIZE <= 1 << 20);
        assert!(4_usize.is_multiple_of(F::WRITE_SIZE) && 4_usize.is_multiple_of(F::READ_SIZE));
        #[expect(clippy::cast_possible_truncation, reason = "asserted two lines above")]
        let bytes = F::ERASE_SIZE as u32;
        bytes / slot::LENGTH
    };

    fn offset(address: SlotAddress) -> u32 {
        (address.sector * Self::SLOTS + address.slot) * slot::LENGTH
    }

    fn read(&mut self, address: SlotAddress) -> Result<Slot, FlashRefused> {
        let mut slot = BLANK;
        self.0.read(Self::offset(address), slot.as_flattened_mut()).map_err(|_| FlashRefused)?;
        Ok(slot)
    }

    /// Reads a sector backwards from its end to the last valid record.
    pub(super) fn survey(&mut self, sector: u32) -> Result<Survey, FlashRefused> {
        let [mark, behind @ ..] = self.read(SlotAddress { sector, slot: 0 })?;
        let revoked = behind.iter().fold(0, |count, word| count + u32::from(*word != BLANK[0]));
        let mut survey = Survey { sector, mark, revoked, end: 1, newest: None };
        for slot in (1..Self::SLOTS).rev() {
            let content = self.read(SlotAddress { sector, slot })?;
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

    /// Programs words in ascending order, then verifies all of them.
    fn program(&mut self, offset: u32, words: &[Word]) -> Result<(), FlashRefused> {
        let mut to = offset;
        for word in words {
            self.0.write(to, word).map_err(|_| FlashRefused)?;
            to += 4;
        }
        let mut from = offset;
        for word in words {
            let mut kept = [0; 4];
            self.0.read(from, &mut kept).map_err(|_| FlashRefused)?;
            if kept != *word {
                return Err(FlashRefused);
            }
            from += 4;
        }
        Ok(())
    }

    /// Programs a record into a blank slot: eight words. The seal follows after the other seven were verified.
    pub(super) fn append(
        &mut self,
        address: SlotAddress,
        generation: u32,
        image: &Image,
    ) -> Result<(), FlashRefused> {
        let [body @ .., seal] = slot::encode(generation, image);
        let offset = Self::offset(address);
        self.program(offset, &body)?;
        self.program(offset + slot::LENGTH - 4, &[seal])
    }

    /// Erases a sector, verifies that it is blank, and programs the mark of `generation`.
    pub(super) fn prepare(&mut self, sector: u32, generation: u32) -> Result<(), FlashRefused> {
        let start = Self::offset(SlotAddress { sector, slot: 0 });
        let end = start + Self::SLOTS * slot::LENGTH;
        self.0.erase(start, end).map_err(|_| FlashRefused)?;
        for slot in 0..Self::SLOTS {
            if self.read(SlotAddress { sector, slot })? != BLANK {
                return Err(FlashRefused);
            }
        }
        self.program(start, &[slot::mark(generation)])
    }

    /// Programs the `count`-th revocation in `sector`: the other sector is to be prepared for `generation` now.
    pub(super) fn revoke(&mut self, sector: u32, count: u32, generation: u32) -> Result<(), FlashRefused> {
        let at = Self::offset(SlotAddress { sector, slot: 0 }) + 4 * count;
        self.program(at, &[slot::mark(generation)])
    }
}
