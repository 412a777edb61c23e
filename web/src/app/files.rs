//! Files that the user saves and opens.

use wasm_bindgen::JsCast;
use wasm_bindgen_futures::{JsFuture, spawn_local};
use web_sys::{Blob, Element, HtmlAnchorElement, HtmlInputElement, Url};

use super::dom::Dom;
use super::page::{App, with_app};

/// Saves a text as a download with this name.
pub(super) fn save(dom: &Dom, name: &str, text: &str) {
    let parts = js_sys::Array::of1(&text.into());
    let address =
        Blob::new_with_str_sequence(&parts).and_then(|blob| Url::create_object_url_with_blob(&blob));
    let Ok(address) = address else { return };
    if let Ok(link) = dom.0.create_element("a").and_then(|link| Ok(link.dyn_into::<HtmlAnchorElement>()?)) {
        link.set_href(&address);
        link.set_download(name);
        link.click();
    }
    // The download has its own reference by now.
    let _ = Url::revoke_object_url(&address);
}

/// Reads the file that the user chose, and then calls `then` with its text. The text is empty if the file cannot be read.
pub(super) fn read(element: &Element, then: fn(&mut App, String)) {
    let Some(input) = element.dyn_ref::<HtmlInputElement>() else { return };
    let Some(file) = input.files().and_then(|files| files.get(0)) else { return };
    // Reset the field: otherwise choosing the same file again, after an edit, causes no event.
    input.set_value("");
    spawn_local(async move {
        let text =
            JsFuture::from(file.text()).await.ok().and_then(|text| text.as_string()).unwrap_or_default();
        with_app(|app| then(app, text));
    });
}
