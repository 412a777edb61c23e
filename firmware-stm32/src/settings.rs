//! The settings between two starts: the journal on its two sectors, and what the controller has to know of
//! it.

use firmware_stm32::flash::Flash;
use motion_core::Storage;
use protocol_core::journal::{Journal, Opened, SaveError};
use protocol_core::registers::Image;

use crate::bank::Bank;

/// The journal and what the start found in it.
pub(crate) struct Settings<'a> {
    journal: Journal<Flash<Bank<'a>>>,
    opened: Opened,
}

impl<'a> Settings<'a> {
    /// Opens the journal. This is where sectors are erased, and the only place.
    pub(crate) fn open(flash: Flash<Bank<'a>>) -> Self {
        let (journal, opened) = Journal::open(flash);
        defmt::info!("settings: {}, room for {=usize}", opened, journal.room());
        Self { journal, opened }
    }

    /// The settings that were found.
    pub(crate) fn found(&self) -> Option<&Image> {
        self.opened.image()
    }

    /// What the storage can do from start.
    pub(crate) fn storage(&self) -> Storage {
        match self.opened {
            Opened::Broken(_) => Storage::Broken,
            _ => self.ready_or_full(),
        }
    }

    /// Saves settings, and says what the storage can still do.
    pub(crate) fn save(&mut self, image: Image) -> Storage {
        let saved = self.journal.save(&image);
        defmt::info!("save: {}, room for {=usize}", saved, self.journal.room());
        match saved {
            Ok(()) => self.ready_or_full(),
            Err(SaveError::Full) => Storage::Full,
            Err(SaveError::Broken) => Storage::Broken,
        }
    }

    fn ready_or_full(&self) -> Storage {
        if self.journal.room() > 0 { Storage::Ready } else { Storage::Full }
    }
}
