//! What a person does: mouse, fingers, keys and files.

use std::path::Path;

use serde_json::{Value, json};

use crate::page::Page;
use system_tests::wait::wait_until;

/// The number of move events of a drag.
const DRAG_STEPS: u32 = 20;

/// The positions of the events of a drag, after its start.
fn way(from: [f64; 2], to: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    (1..=DRAG_STEPS).map(move |step| {
        let share = f64::from(step) / f64::from(DRAG_STEPS);
        [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]))
    })
}

impl Page {
    /// Scrolls an element into view. Returns its centre in CSS pixels.
    #[track_caller]
    pub fn centre(&mut self, selector: &str) -> [f64; 2] {
        let script = format!(
            "(() => {{ const e = document.querySelector(`{selector}`); e.scrollIntoView({{block: 'center'}}); \
             const r = e.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; }})()"
        );
        let place = self.evaluate(&script);
        [place[0].as_f64().expect("a number"), place[1].as_f64().expect("a number")]
    }

    /// Clicks an element with the mouse.
    #[track_caller]
    pub fn click(&mut self, selector: &str) {
        let place = self.centre(selector);
        self.press(place);
        self.release(place);
    }

    /// Taps an element with a finger.
    #[track_caller]
    pub fn tap(&mut self, selector: &str) {
        let [x, y] = self.centre(selector);
        let fingers = [("touchStart", json!([{ "x": x, "y": y }])), ("touchEnd", json!([]))];
        for (kind, points) in fingers {
            self.call("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": points }));
        }
    }

    /// Drags the mouse from one place to another, and lets go.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.drag_and_hold(from, to);
        self.release(to);
    }

    /// Drags the mouse from one place to another, and keeps its button down.
    pub fn drag_and_hold(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.mouse("mouseMoved", from, 0);
        self.press(from);
        way(from, to).for_each(|at| self.mouse("mouseMoved", at, 1));
    }

    /// Presses the button of the mouse.
    pub fn press(&mut self, at: [f64; 2]) {
        self.mouse("mousePressed", at, 1);
    }

    /// Releases the button of the mouse.
    pub fn release(&mut self, at: [f64; 2]) {
        self.mouse("mouseReleased", at, 0);
    }

    fn mouse(&mut self, kind: &str, [x, y]: [f64; 2], pressed: u32) {
        // A move during a drag has to name the button: without it, the page's capture of the pointer would end.
        let button = if kind == "mouseMoved" && pressed == 0 { "none" } else { "left" };
        let event =
            json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": pressed, "clickCount": 1 });
        self.call("Input.dispatchMouseEvent", event);
    }

    /// Presses a key such as `Tab`, `ArrowUp` or a space this number of times.
    pub fn keys(&mut self, key: &str, times: usize) {
        let (code, number, text) = match key {
            " " => ("Space", 32, " "),
            "Enter" => ("Enter", 13, "\r"),
            "Tab" => ("Tab", 9, ""),
            "Escape" => ("Escape", 27, ""),
            "ArrowLeft" => ("ArrowLeft", 37, ""),
            "ArrowUp" => ("ArrowUp", 38, ""),
            "ArrowRight" => ("ArrowRight", 39, ""),
            "ArrowDown" => ("ArrowDown", 40, ""),
            "Home" => ("Home", 36, ""),
            "End" => ("End", 35, ""),
            _ => panic!("no key {key}"),
        };
        let down = if text.is_empty() { "rawKeyDown" } else { "keyDown" };
        for kind in [down, "keyUp"].into_iter().cycle().take(2 * times) {
            let event = json!({ "type": kind, "key": key, "code": code, "windowsVirtualKeyCode": number, "text": text });
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Presses one of the keys of [`Self::keys`] once.
    pub fn key(&mut self, key: &str) {
        self.keys(key, 1);
    }

    /// Replaces the content of a field, and presses Enter.
    #[track_caller]
    pub fn type_into(&mut self, selector: &str, text: &str) {
        self.evaluate(&format!("document.querySelector(`{selector}`).select()"));
        self.focus(selector);
        self.call("Input.insertText", json!({ "text": text }));
        self.key("Enter");
    }

    /// Moves a finger from one place to another.
    pub fn swipe(&mut self, from: [f64; 2], to: [f64; 2]) {
        let mut touch = |kind: &str, points: Value| {
            self.call("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": points }));
        };
        touch("touchStart", json!([{ "x": from[0], "y": from[1] }]));
        way(from, to).for_each(|[x, y]| touch("touchMove", json!([{ "x": x, "y": y }])));
        touch("touchEnd", json!([]));
    }

    /// Chooses an option of a list.
    #[track_caller]
    pub fn choose(&mut self, selector: &str, value: &str) {
        self.evaluate(&format!(
            "(list => {{ list.value = `{value}`; list.dispatchEvent(new Event('change', {{bubbles: true}})); }})\
             (document.querySelector(`{selector}`))"
        ));
    }

    /// Moves all sliders, with an `input` event for each, as a person would cause it, but without a pause between them.
    #[track_caller]
    pub fn slide_all(&mut self, degrees: [u32; 7]) {
        self.evaluate(&format!(
            "{degrees:?}.forEach((degrees, index) => {{ const slider = document.querySelector('#joint-' + (index + 1)); \
             slider.value = degrees; slider.dispatchEvent(new Event('input', {{bubbles: true}})); }})"
        ));
    }

    /// Writes a register in the table of the page. Opens the panel of the table for this, if it is closed.
    #[track_caller]
    pub fn write_register(&mut self, address: u8, value: &str) {
        let panel = "document.querySelector('#registers-panel').open";
        let was_open = self.evaluate(panel);
        self.evaluate(&format!("{panel} = true"));
        let input = format!("document.querySelector('#register-{address}-value')");
        wait_until("the table of registers is there", || self.evaluate(&format!("{input} != null")) == true);
        self.evaluate(&format!(
            "(input => {{ input.focus(); input.value = `{value}`; \
             input.dispatchEvent(new Event('change', {{bubbles: true}})); }})({input})"
        ));
        self.evaluate(&format!("{panel} = {was_open}"));
    }

    /// Stores the downloads of this browser context in a folder.
    pub fn download_to(&mut self, folder: &Path) {
        let behaviour =
            json!({ "behavior": "allow", "downloadPath": folder, "browserContextId": self.browser.id });
        self.call("Browser.setDownloadBehavior", behaviour);
    }

    /// Gives a file to the file input that `selector` finds.
    #[track_caller]
    pub fn choose_file(&mut self, selector: &str, file: &Path) {
        let root = &self.call("DOM.getDocument", json!({}))["root"]["nodeId"];
        let node = self.call("DOM.querySelector", json!({ "nodeId": root, "selector": selector }));
        let choice = json!({ "files": [file], "nodeId": node["nodeId"] });
        self.call("DOM.setFileInputFiles", choice);
    }
}
