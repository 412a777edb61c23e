//! The editor of block programs, a script that is loaded when it is first needed: `web/block-editor`.

use js_sys::{Array, Function, Object, Promise, Reflect};
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast, JsValue};
use web_sys::Element;

use super::dom::Dom;
use super::page::{App, with_app};

/// Its file, beside the page.
const FILE: &str = "programs.js";
/// A page in one file has the script as the text of this element.
const TEXT_OF_SCRIPT: &str = "programs";

/// The element that loads it.
const SCRIPT: &str = "editor-script";

/// The editor. Its calls do nothing before it is loaded.
#[derive(Clone, Copy)]
pub(super) struct Editor;

impl Editor {
    /// Loads the script if it is neither there nor on its way, and calls `loaded` then, or `failed`. After a failure the next
    /// call tries again.
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
            // The page is busy now.
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

    /// Is the script there?
    pub(super) fn is_loaded(self) -> bool {
        object().is_some()
    }

    /// Shows it in an element. `changed` is called after each edit of the program.
    pub(super) fn open(self, element: &Element, language: &str, changed: fn(&mut App)) {
        let changed = Closure::<dyn FnMut()>::new(move || {
            with_app(changed);
        });
        call("open", &[element.into(), language.into(), changed.into_js_value()]);
    }

    /// The program.
    pub(super) fn text(self) -> Option<String> {
        call("text", &[])?.as_string()
    }

    /// Shows a program. Returns why it is none, or an empty text.
    pub(super) fn show(self, program: &str, can_undo: bool) -> String {
        call("load", &[program.into(), can_undo.into()]).and_then(|why| why.as_string()).unwrap_or_default()
    }

    /// Lights a block, or none.
    pub(super) fn light(self, block: Option<&str>) {
        call("light", &[block.into()]);
    }

    /// Shows at a block what is wrong, or at none.
    pub(super) fn warn(self, block: Option<&str>, text: &str) {
        call("warn", &[block.into(), text.into()]);
    }

    /// Adds a pose at the end of the program.
    pub(super) fn add_pose(self, degrees: [f64; 7]) {
        let angles: Array = degrees.iter().map(|&angle| JsValue::from(angle)).collect();
        call("addPose", &[angles.into()]);
    }

    /// Copies a text to the clipboard.
    pub(super) fn copy(self, text: &str) {
        call("copy", &[text.into()]);
    }

    /// The letters of a program for an address.
    pub(super) fn pack(self, program: &str) -> Option<Promise> {
        call("pack", &[program.into()])?.dyn_into().ok()
    }

    /// The program of the letters of an address; an empty text if it is none.
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
