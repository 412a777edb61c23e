//! What the browser keeps for this page over a reload. A browser that keeps nothing, as in a private window, is no fault.

use web_sys::Storage;

fn storage() -> Option<Storage> {
    web_sys::window()?.local_storage().ok()?
}

/// What was kept under this name.
pub(super) fn load(name: &str) -> Option<String> {
    storage()?.get_item(name).ok()?
}

/// What was kept for this tab under this name.
pub(super) fn load_of_tab(name: &str) -> Option<String> {
    storage_of_tab()?.get_item(name).ok()?
}

/// Keeps a text for this tab: others of the same browser do not have it.
pub(super) fn save_of_tab(name: &str, text: &str) {
    if let Some(storage) = storage_of_tab() {
        let _ = storage.set_item(name, text);
    }
}

fn storage_of_tab() -> Option<Storage> {
    web_sys::window()?.session_storage().ok()?
}

/// Keeps a text. A full storage keeps what it had.
pub(super) fn save(name: &str, text: &str) {
    if let Some(storage) = storage() {
        let _ = storage.set_item(name, text);
    }
}
