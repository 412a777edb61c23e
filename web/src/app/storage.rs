//! Values that the browser stores for this page across a reload. A browser that stores nothing, as in a private window,
//! is not an error.

use web_sys::Storage;

fn storage() -> Option<Storage> {
    web_sys::window()?.local_storage().ok()?
}

/// Loads the value with this name; `None` if there is none.
pub(super) fn load(name: &str) -> Option<String> {
    storage()?.get_item(name).ok()?
}

/// Loads this tab's value with this name; `None` if there is none.
pub(super) fn load_of_tab(name: &str) -> Option<String> {
    storage_of_tab()?.get_item(name).ok()?
}

/// Stores a value for this tab only. Other tabs of the same browser do not see it.
pub(super) fn save_of_tab(name: &str, text: &str) {
    if let Some(storage) = storage_of_tab() {
        let _ = storage.set_item(name, text);
    }
}

fn storage_of_tab() -> Option<Storage> {
    web_sys::window()?.session_storage().ok()?
}

/// Stores a value. If the storage is full, the old value stays.
pub(super) fn save(name: &str, text: &str) {
    if let Some(storage) = storage() {
        let _ = storage.set_item(name, text);
    }
}
