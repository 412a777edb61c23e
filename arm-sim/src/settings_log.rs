//! Logs the state of the settings storage.

use embedded_storage::nor_flash::NorFlash;
use protocol_core::journal::Opened;
use protocol_core::settings::{Settings, Storage};
use tracing::{debug, info, warn};

/// Logs the result of opening the journal at a start.
pub(crate) fn opened<F: NorFlash>(settings: &Settings<F>) {
    match settings.opened() {
        Opened::Found(_) => debug!("settings found, room for {} more", settings.room()),
        Opened::Fresh => debug!("no settings yet"),
        Opened::Damaged => warn!("settings image damaged: default settings"),
        Opened::Broken(_) => warn!("settings cannot be stored: they last until the end only"),
    }
}

/// Logs the result of a save.
pub(crate) fn saved<F: NorFlash>(settings: &Settings<F>) {
    match settings.storage() {
        Storage::Ready => info!("settings saved, room for {} more", settings.room()),
        Storage::Full => warn!("settings journal full until the next power cycle (SIGHUP)"),
        Storage::Broken => warn!("settings not saved: they last until the next power cycle only"),
    }
}
