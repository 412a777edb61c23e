//! Links: makes an address that contains a program, and opens the program of an address.

use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::{JsFuture, spawn_local};
use web_sys::{Event, HtmlInputElement};

use super::editor::Editor;
use super::page::{App, with_app};

/// The beginning of the fragment of an address with a program.
const FRAGMENT: &str = "#program=";

/// Installs a handler that opens the program of the address when the address changes.
pub(super) fn listen() -> Result<(), JsValue> {
    let window = web_sys::window().ok_or("no window")?;
    let changed = Closure::<dyn FnMut(Event)>::new(|_| {
        with_app(App::open_link);
    });
    window.add_event_listener_with_callback("hashchange", changed.as_ref().unchecked_ref())?;
    changed.forget();
    Ok(())
}

impl App {
    /// Makes an address that contains the program, shows it, and copies it to the clipboard.
    pub(super) fn share(&mut self) {
        let Some(letters) = Editor.pack(&self.programs.text) else { return };
        spawn_local(async move {
            let letters = JsFuture::from(letters).await.ok().and_then(|letters| letters.as_string());
            with_app(|app| app.show_link(&letters.unwrap_or_default()));
        });
    }

    fn show_link(&self, letters: &str) {
        let Some(location) = web_sys::window().map(|window| window.location()) else { return };
        // Omit the query of the address: it may contain the token of a server.
        let page = location.origin().unwrap_or_default() + &location.pathname().unwrap_or_default();
        let link = format!("{page}{FRAGMENT}{letters}");
        if let Ok(field) = self.dom.get::<HtmlInputElement>("program-link") {
            field.set_value(&link);
            self.dom.set_hidden("link-row", false);
            field.select();
        }
        Editor.copy(&link);
    }

    /// Opens the program of the page's address, if it contains one. Loads the editor first, if necessary.
    pub(super) fn open_link(&mut self) {
        let Some(window) = web_sys::window() else { return };
        let fragment = window.location().hash().unwrap_or_default();
        let Some(letters) = fragment.strip_prefix(FRAGMENT) else { return };
        if !Editor.is_loaded() {
            // After the editor is loaded, `show_editor` calls this again.
            if !self.programs.is_open {
                self.toggle_programs();
            }
            return;
        }
        // Remove the fragment, so that a reload shows the edited program, not the program of the link.
        let address = window.location().pathname().unwrap_or_default()
            + &window.location().search().unwrap_or_default();
        if let Ok(history) = window.history() {
            let _ = history.replace_state_with_url(&JsValue::NULL, "", Some(&address));
        }
        let Some(text) = Editor.unpack(letters) else { return };
        spawn_local(async move {
            let text = JsFuture::from(text).await.ok().and_then(|text| text.as_string());
            with_app(|app| match text.filter(|text| !text.is_empty()) {
                Some(text) => app.open_program(text),
                None => app.dom.notice(app.language.text("bad-link")),
            });
        });
    }
}
