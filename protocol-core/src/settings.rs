//! The stored settings: the journal on a flash, and whether it takes another save.

use embedded_storage::nor_flash::NorFlash;

use crate::journal::{Journal, Opened, SaveError};
use crate::registers::Image;

/// The state of the settings storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Storage {
    /// The storage takes another image.
    Ready,
    /// The storage is full until the next restart. Writes that change a setting are refused
    /// ([D19](crate::decisions#d19)).
    Full,
    /// The storage does not keep data. New settings live in RAM only.
    Broken,
}

/// The journal, and the settings that it held at start.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Settings<F> {
    journal: Journal<F>,
    opened: Opened,
    storage: Storage,
}

impl<F: NorFlash> Settings<F> {
    /// Opens the journal. Only this function and [`Settings::reopen`] erase sectors.
    pub fn open(flash: F) -> Self {
        let (journal, opened) = Journal::open(flash);
        let storage = storage_after(&journal, &opened);
        Self { journal, opened, storage }
    }

    /// Opens the journal again, as the next start does.
    pub fn reopen(&mut self) {
        self.opened = self.journal.reopen();
        self.storage = storage_after(&self.journal, &self.opened);
    }

    /// The flash, for a test or a simulator that changes it.
    pub const fn flash_mut(&mut self) -> &mut F {
        self.journal.flash_mut()
    }

    /// The result of opening the journal.
    pub const fn opened(&self) -> &Opened {
        &self.opened
    }

    /// The settings that the journal held at start or at the last [`Settings::reopen`], if any.
    #[must_use]
    pub const fn found(&self) -> Option<&Image> {
        self.opened.image()
    }

    /// The state of the storage after start, or after the last save.
    #[must_use]
    pub const fn storage(&self) -> Storage {
        self.storage
    }

    /// The number of saves for which there is room before the next start.
    #[must_use]
    pub fn room(&self) -> usize {
        self.journal.room()
    }

    /// Saves `image` and returns the state of the storage after that.
    pub fn save(&mut self, image: &Image) -> Storage {
        self.storage = match self.journal.save(image) {
            Ok(()) => ready_or_full(&self.journal),
            Err(SaveError::Full) => Storage::Full,
            Err(SaveError::Broken) => Storage::Broken,
        };
        self.storage
    }
}

fn storage_after<F: NorFlash>(journal: &Journal<F>, opened: &Opened) -> Storage {
    if matches!(opened, Opened::Broken(_)) { Storage::Broken } else { ready_or_full(journal) }
}

fn ready_or_full<F: NorFlash>(journal: &Journal<F>) -> Storage {
    if journal.room() > 0 { Storage::Ready } else { Storage::Full }
}

#[cfg(test)]
mod tests {
    use flash_model::Flash;

    use super::*;

    const IMAGE: Image = Image([7; Image::LENGTH]);
    const SECTOR: usize = 1024;

    /// The journal does not save an image that it already holds, so each save needs another one.
    fn image(number: usize) -> Image {
        let [low, ..] = number.to_le_bytes();
        Image([low; Image::LENGTH])
    }

    #[test]
    fn saved_settings_are_found_at_the_next_start() {
        let mut settings = Settings::open(Flash::<SECTOR>::new(2));
        assert_eq!((settings.found(), settings.storage()), (None, Storage::Ready));
        assert_eq!(settings.opened(), &Opened::Fresh);
        assert_eq!(settings.save(&IMAGE), Storage::Ready);
        settings.reopen();
        assert_eq!((settings.found(), settings.storage()), (Some(&IMAGE), Storage::Ready));
        assert_eq!(Settings::open(settings.flash_mut().clone()).found(), Some(&IMAGE));
    }

    #[test]
    fn the_save_that_uses_the_last_slot_reports_a_full_storage() {
        let mut settings = Settings::open(Flash::<SECTOR>::new(2));
        let room = settings.room();
        for save in 1..room {
            assert_eq!(settings.save(&image(save)), Storage::Ready, "save {save} of {room}");
        }
        assert_eq!(settings.save(&image(room)), Storage::Full);
        assert_eq!(settings.save(&image(0)), Storage::Full, "a save without room");
        let settings = Settings::open(settings.journal.release());
        assert_eq!((settings.found(), settings.storage()), (Some(&image(room)), Storage::Ready));
    }

    #[test]
    fn a_flash_that_changes_nothing_is_a_broken_storage() {
        let mut settings = Settings::open(Flash::<SECTOR>::inert(&[0; 2 * SECTOR]));
        assert_eq!((settings.found(), settings.storage()), (None, Storage::Broken));
        assert_eq!(settings.save(&IMAGE), Storage::Broken);
    }
}
