//! Finds and changes the elements of the page.

use wasm_bindgen::{JsCast, JsValue};
use web_sys::{Document, Element, HtmlCanvasElement, HtmlElement, HtmlInputElement, HtmlSelectElement};

use crate::texts::Language;

#[derive(Clone)]
pub(super) struct Dom(pub(super) Document);

impl Dom {
    pub(super) fn of_window() -> Result<Self, JsValue> {
        let window = web_sys::window().ok_or("no window")?;
        Ok(Self(window.document().ok_or("no document")?))
    }

    /// The element with this identifier. Fails if the page has no such element, or if its type is not `E`.
    pub(super) fn get<E: JsCast>(&self, id: &str) -> Result<E, JsValue> {
        let element = self.0.get_element_by_id(id);
        let element = element.ok_or_else(|| JsValue::from(format!("the page has no {id}")))?;
        element.dyn_into().map_err(|_| JsValue::from(format!("{id} is another kind of element")))
    }

    pub(super) fn element(&self, id: &str) -> Option<HtmlElement> {
        self.get(id).ok()
    }

    pub(super) fn canvas(&self, id: &str) -> Result<HtmlCanvasElement, JsValue> {
        self.get(id)
    }

    pub(super) fn choice(&self, id: &str) -> String {
        self.get::<HtmlSelectElement>(id).map(|select| select.value()).unwrap_or_default()
    }

    pub(super) fn choose(&self, id: &str, value: &str) {
        if let Ok(select) = self.get::<HtmlSelectElement>(id) {
            select.set_value(value);
        }
    }

    /// Sets a text only if it differs, because a screen reader announces a live region on each change.
    pub(super) fn set_text(&self, id: &str, text: &str) {
        if let Some(element) = self.element(id) {
            set_text(&element, text);
        }
    }

    pub(super) fn set_hidden(&self, id: &str, is_hidden: bool) {
        if let Some(element) = self.element(id) {
            element.set_hidden(is_hidden);
        }
    }

    /// Appends a new element to `parent`.
    pub(super) fn add(&self, parent: &Element, kind: &str) -> Result<Element, JsValue> {
        let element = self.0.create_element(kind)?;
        parent.append_child(&element)?;
        Ok(element)
    }

    /// Marks one button of a group as pressed. All buttons of a group have the same action; the pressed one has this value.
    pub(super) fn press(&self, action: &str, value: &str) {
        for button in self.all(&format!("[data-action={action}]")) {
            let is_pressed = button.get_attribute("data-value").as_deref() == Some(value);
            set_attribute(&button, "aria-pressed", if is_pressed { "true" } else { "false" });
        }
    }

    pub(super) fn all(&self, selector: &str) -> Vec<Element> {
        let Ok(list) = self.0.query_selector_all(selector) else { return Vec::new() };
        (0..list.length()).filter_map(|index| list.get(index)?.dyn_into().ok()).collect()
    }

    /// Shows all texts in a language.
    pub(super) fn translate(&self, language: Language) {
        for (attribute, is_label) in [("data-text", false), ("data-label", true)] {
            for element in self.all(&format!("[{attribute}]")) {
                let name = element.get_attribute(attribute).unwrap_or_default();
                let text = language.find(&name).unwrap_or_default();
                if is_label {
                    set_attribute(&element, "aria-label", text);
                } else {
                    set_text(&element, text);
                }
            }
        }
        if let Some(root) = self.0.document_element() {
            set_attribute(&root, "lang", language.tag());
        }
    }

    pub(super) fn notice(&self, text: &str) {
        self.set_text("notice", text);
        self.set_hidden("notice-bar", false);
    }

    /// Shows a notice with the reason why there is no picture of the arm. The rest of the page works.
    pub(super) fn no_picture(&self, language: Language, reason: &JsValue) {
        let reason = reason.as_string().unwrap_or_else(|| format!("{reason:?}"));
        self.notice(&format!("{} {reason}", language.text("no-picture")));
    }

    pub(super) fn end_notice(&self) {
        self.set_hidden("notice-bar", true);
        self.set_text("notice", "");
    }

    /// Removes the notice if it still has this text.
    pub(super) fn end_notice_of(&self, text: &str) {
        if self.element("notice").and_then(|notice| notice.text_content()).as_deref() == Some(text) {
            self.end_notice();
        }
    }

    pub(super) fn has_focus(&self, element: &Element) -> bool {
        self.0.active_element().is_some_and(|active| active == *element)
    }
}

pub(super) fn set_text(element: &Element, text: &str) {
    if element.text_content().as_deref() != Some(text) {
        element.set_text_content(Some(text));
    }
}

pub(super) fn set_attribute(element: &Element, name: &str, value: &str) {
    if element.get_attribute(name).as_deref() != Some(value) {
        // Only a malformed name is an error.
        let _ = element.set_attribute(name, value);
    }
}

/// The number in a slider or an input; `None` if it holds no number.
pub(super) fn number(input: &HtmlInputElement) -> Option<f32> {
    input.value().parse().ok()
}
