//! Calls the editor of block programs in `web/block-editor`, a script that the page loads when it first needs it.

use js_sys::{Array, Function, Object, Promise, Reflect};
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast, JsValue};
use web_sys::Element;

use super::dom::Dom;
use super::page::{App, with_app};

/// The file of the script, in the folder of the page.
const FILE: &str = "programs.js";
/// The id of the element that contains the text of the script, on a page in one file.
const TEXT_OF_SCRIPT: &str = "programs";

/// The id of the element that loads the script.
const SCRIPT: &str = "editor-script";

/// The editor. Before it is loaded, only [`Self::load`] has an effect.
#[derive(Clone, Copy)]
pub(super) struct Editor;

impl Editor {
    /// Loads the script, and then calls `loaded`, or `failed` if the browser cannot load it. Has no effect if the script is
    /// loaded or being loaded. After a failure the next call tries again.
    pub(super) fn load(self, dom: &Dom, loaded: fn(&mut App), failed: fn(&mut App)) -> Result<(), JsValue> {
        if object().is_some() || dom.element(SCRIPT).is_some() {
            return Ok(());
        }
        let script = dom.0.create_element("script")?;
        script.set_id(SCRIPT);
        let head = dom.0.document_element().ok_or("no document")?;
        let call = Closure::once_into_js(move || {
            with_app(loaded);
        });
        if let Some(text) = dom.element(TEXT_OF_SCRIPT) {
            script.set_text_content(text.text_content().as_deref());
            head.append_child(&script)?;
            // The script runs at once, but `with_app` cannot borrow the page here. So call `loaded` later.
            let window = web_sys::window().ok_or("no window")?;
            window.set_timeout_with_callback(call.unchecked_ref())?;
        } else {
            script.set_attribute("src", FILE)?;
            script.add_event_listener_with_callback("load", call.unchecked_ref())?;
            let lost = script.clone();
            let failed = Closure::once_into_js(move || {
                lost.remove();
                with_app(failed);
            });
            script.add_event_listener_with_callback("error", failed.unchecked_ref())?;
            head.append_child(&script)?;
        }
        Ok(())
    }

    pub(super) fn is_loaded(self) -> bool {
        object().is_some()
    }

    /// Shows the editor in an element, in the language of this tag. Calls `changed` after each edit of the program.
    pub(super) fn open(self, element: &Element, language: &str, changed: fn(&mut App)) {
        let changed = Closure::<dyn FnMut()>::new(move || {
            with_app(changed);
        });
        call("open", &[element.into(), language.into(), changed.into_js_value()]);
    }

    /// The program as the JSON of a Blockly workspace; `None` before the editor is open.
    pub(super) fn text(self) -> Option<String> {
        call("text", &[])?.as_string()
    }

    /// Replaces the program, and returns an empty text. If the new text is no program, keeps the old program and returns the
    /// error. With `can_undo`, the user can undo the replacement.
    pub(super) fn show(self, program: &str, can_undo: bool) -> String {
        call("load", &[program.into(), can_undo.into()]).and_then(|why| why.as_string()).unwrap_or_default()
    }

    /// Lights this block, and no other.
    pub(super) fn light(self, block: Option<&str>) {
        call("light", &[block.into()]);
    }

    /// Shows a warning at this block, and removes all others.
    pub(super) fn warn(self, block: Option<&str>, text: &str) {
        call("warn", &[block.into(), text.into()]);
    }

    /// Adds a pose, in degrees, at the end of the program.
    pub(super) fn add_pose(self, degrees: [f64; 7]) {
        let angles: Array = degrees.iter().map(|&angle| JsValue::from(angle)).collect();
        call("addPose", &[angles.into()]);
    }

    /// Copies a text to the clipboard.
    pub(super) fn copy(self, text: &str) {
        call("copy", &[text.into()]);
    }

    /// Compresses a program to letters for an address. The promise gives a string.
    pub(super) fn pack(self, program: &str) -> Option<Promise> {
        call("pack", &[program.into()])?.dyn_into().ok()
    }

    /// Decodes the letters of an address to a program. The promise gives a string, which is empty if the decoding fails.
    pub(super) fn unpack(self, letters: &str) -> Option<Promise> {
        call("unpack", &[letters.into()])?.dyn_into().ok()
    }
}

fn object() -> Option<Object> {
    Reflect::get(web_sys::window()?.as_ref(), &"blockEditor".into()).ok()?.dyn_into().ok()
}

fn call(name: &str, arguments: &[JsValue]) -> Option<JsValue> {
    let object = object()?;
    let function: Function = Reflect::get(&object, &name.into()).ok()?.dyn_into().ok()?;
    Reflect::apply(&function, &object, &arguments.iter().collect()).ok()
}
