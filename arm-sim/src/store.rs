//! The settings between two power-ups: the journal on a flash, and what the controller has to know of it.

use embedded_storage::nor_flash::NorFlash;
use motion_core::Storage;
use protocol_core::journal::{Journal, Opened, SaveError};
use protocol_core::registers::Image;
use tracing::{debug, info, warn};

/// A journal, its flash, and the state they are in.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
    journal: Journal<F>,
    state: Storage,
}

impl<F: NorFlash + Clone> Store<F> {
    /// Opens the journal on a flash, as at power-up, and gives the settings it holds. Clones of `flash` must
    /// be handles to the same cells.
    pub fn open(flash: F) -> (Self, Option<Image>) {
        let (journal, opened) = Journal::open(flash.clone());
        match opened {
            Opened::Found(_) => debug!("settings found, room for {} more", journal.room()),
            Opened::Fresh => debug!("no settings yet"),
            Opened::Damaged => warn!("settings image damaged: default settings"),
            Opened::Broken(_) => warn!("settings cannot be stored: they last until the end only"),
        }
        let state = match opened {
            Opened::Broken(_) => Storage::Broken,
            _ if journal.room() == 0 => Storage::Full,
            _ => Storage::Ready,
        };
        (Self { flash, journal, state }, opened.image().copied())
    }

    /// The flash underneath.
    #[must_use]
    pub const fn flash(&self) -> &F {
        &self.flash
    }

    /// What the storage can still do.
    #[must_use]
    pub const fn state(&self) -> Storage {
        self.state
    }

    /// Saves settings, and says what the storage can still do after that.
    pub fn save(&mut self, image: &Image) -> Storage {
        self.state = match self.journal.save(image) {
            Ok(()) if self.journal.room() > 0 => Storage::Ready,
            Ok(()) | Err(SaveError::Full) => Storage::Full,
            Err(SaveError::Broken) => Storage::Broken,
        };
        match self.state {
            Storage::Ready => info!("settings saved, room for {} more", self.journal.room()),
            Storage::Full => warn!("settings journal full until the next power cycle (SIGHUP)"),
            Storage::Broken => warn!("settings not saved: they last until the next power cycle only"),
        }
        self.state
    }
}

/// Is there something on this flash, but no settings journal? Looks at a copy, as opening one would erase
/// what is there.
#[must_use]
pub fn is_damaged<F: NorFlash>(copy: F) -> bool {
    matches!(Journal::open(copy), (_, Opened::Damaged))
}
