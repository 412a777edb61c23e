//! What a person does: mouse, fingers, keys and files.

use std::path::Path;

use chromiumoxide::cdp::browser_protocol::browser::{SetDownloadBehaviorBehavior, SetDownloadBehaviorParams};
use chromiumoxide::cdp::browser_protocol::dom::{
    GetDocumentParams, QuerySelectorParams, SetFileInputFilesParams,
};
use chromiumoxide::cdp::browser_protocol::input::{
    DispatchKeyEventParams, DispatchKeyEventType, DispatchMouseEventParams, DispatchMouseEventType,
    DispatchTouchEventParams, DispatchTouchEventReturns, DispatchTouchEventType, MouseButton, TouchPoint,
};

use chromiumoxide::types::{Command, Method, MethodId};
use serde::Serialize;

use crate::page::Page;

/// How many events a drag has between its ends.
const DRAG_STEPS: u32 = 20;

/// The finger goes up. The library's own command leaves an empty list out, which the browser refuses.
#[derive(Debug, Serialize)]
struct TouchEnd {
    #[serde(rename = "type")]
    kind: &'static str,
    #[serde(rename = "touchPoints")]
    touch_points: [u8; 0],
}

impl Method for TouchEnd {
    fn identifier(&self) -> MethodId {
        "Input.dispatchTouchEvent".into()
    }
}

impl Command for TouchEnd {
    type Response = DispatchTouchEventReturns;
}

impl Page {
    /// The centre of an element in CSS pixels, scrolled into view.
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
        let finger = vec![TouchPoint::new(x, y)];
        self.call(DispatchTouchEventParams::new(DispatchTouchEventType::TouchStart, finger));
        self.call(TouchEnd { kind: "touchEnd", touch_points: [] });
    }

    /// Drags the mouse from one place to another, and lets go.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.drag_and_hold(from, to);
        self.release(to);
    }

    /// Drags the mouse from one place to another, and keeps its button down.
    pub fn drag_and_hold(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.mouse(DispatchMouseEventType::MouseMoved, from, 0);
        self.press(from);
        for step in 1..=DRAG_STEPS {
            let share = f64::from(step) / f64::from(DRAG_STEPS);
            let at = |axis: usize| from[axis] + share * (to[axis] - from[axis]);
            self.mouse(DispatchMouseEventType::MouseMoved, [at(0), at(1)], 1);
        }
    }

    /// Presses the button of the mouse.
    pub fn press(&mut self, at: [f64; 2]) {
        self.mouse(DispatchMouseEventType::MousePressed, at, 1);
    }

    /// Releases the button of the mouse.
    pub fn release(&mut self, at: [f64; 2]) {
        self.mouse(DispatchMouseEventType::MouseReleased, at, 0);
    }

    fn mouse(&mut self, kind: DispatchMouseEventType, [x, y]: [f64; 2], pressed: i64) {
        // A move with no button would end the pointer's capture by the page.
        let is_hover = kind == DispatchMouseEventType::MouseMoved && pressed == 0;
        let button = if is_hover { MouseButton::None } else { MouseButton::Left };
        let mut event = DispatchMouseEventParams::new(kind, x, y);
        (event.button, event.buttons, event.click_count) = (Some(button), Some(pressed), Some(1));
        self.call(event);
    }

    /// Presses a key such as `Tab`, `ArrowUp` or a space, as often as asked.
    pub fn keys(&mut self, key: &str, times: u32) {
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
        let down =
            if text.is_empty() { DispatchKeyEventType::RawKeyDown } else { DispatchKeyEventType::KeyDown };
        for _ in 0..times {
            for kind in [down.clone(), DispatchKeyEventType::KeyUp] {
                let mut event = DispatchKeyEventParams::new(kind);
                (event.key, event.code) = (Some(key.to_owned()), Some(code.to_owned()));
                (event.windows_virtual_key_code, event.text) = (Some(number), Some(text.to_owned()));
                self.call(event);
            }
        }
    }

    /// Presses a key once.
    pub fn key(&mut self, key: &str) {
        self.keys(key, 1);
    }

    /// Chooses an option of a list.
    #[track_caller]
    pub fn choose(&mut self, selector: &str, value: &str) {
        self.evaluate(&format!(
            "(list => {{ list.value = `{value}`; list.dispatchEvent(new Event('change', {{bubbles: true}})); }})\
             (document.querySelector(`{selector}`))"
        ));
    }

    /// Lets downloads go to a folder.
    pub fn download_to(&mut self, folder: &Path) {
        let mut parameters = SetDownloadBehaviorParams::new(SetDownloadBehaviorBehavior::Allow);
        parameters.download_path = Some(folder.display().to_string());
        self.call(parameters);
    }

    /// Chooses a file.
    #[track_caller]
    pub fn choose_file(&mut self, selector: &str, file: &Path) {
        let root = self.call(GetDocumentParams::default()).root.node_id;
        let node = self.call(QuerySelectorParams::new(root, selector)).node_id;
        let mut parameters = SetFileInputFilesParams::new(vec![file.display().to_string()]);
        parameters.node_id = Some(node);
        self.call(parameters);
    }
}
