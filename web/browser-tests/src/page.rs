//! A page in the browser: its values, its pictures, its errors and its requests.

use std::rc::Rc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use system_tests::wait::{wait_for, wait_until};

use crate::browser::BrowserContext;
use crate::connection::{Connection, variable};
use crate::picture::Picture;

/// The register that tells which joints have a moving set-point.
const MOVING_JOINTS: usize = sevenbot::map::MOVING_JOINTS.address as usize;
/// A script that keeps each text that these elements show, because a test may be too late for a text that is soon replaced.
const KEEP_TEXTS: &str = "
    window.said = [];
    (() => {
      const last = {};
      new MutationObserver(() => {
        for (const id of ['state', 'notice', 'recording']) {
          const text = document.getElementById(id)?.textContent ?? '';
          if (text != (last[id] ?? '')) window.said.push(['#' + id, last[id] = text]);
        }
      }).observe(document, { subtree: true, childList: true, characterData: true });
    })();";

/// A page in a window of Chromium.
#[derive(Debug)]
pub struct Page {
    connection: Connection,
    pub(crate) browser: Rc<BrowserContext>,
    /// The number of kept texts up to the last one that the test waited for.
    heard: usize,
}

/// How the page is shown.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// Width in CSS pixels.
    pub width: u32,
    /// Height in CSS pixels.
    pub height: u32,
    /// The user prefers dark colours.
    pub is_dark: bool,
    /// A phone with a touch screen.
    pub is_phone: bool,
}

/// A desktop computer with light colours.
pub const DESKTOP: Screen = Screen { width: 1_280, height: 720, is_dark: false, is_phone: false };
/// A desktop computer with dark colours.
pub const DARK: Screen = Screen { is_dark: true, ..DESKTOP };
/// A phone in portrait format, with light colours.
pub const PHONE: Screen = Screen { width: 390, height: 844, is_dark: false, is_phone: true };

impl Page {
    /// Opens an address on a desktop, and waits until the page has drawn a picture.
    #[must_use]
    pub fn open(url: &str) -> Self {
        Self::open_after(url, "")
    }

    /// As [`Self::open`]. `script` runs before the scripts of the page.
    #[must_use]
    pub fn open_after(url: &str, script: &str) -> Self {
        Self::open_in(Rc::new(BrowserContext::open()), url, script)
    }

    /// Opens an address in another window of the same browser. `script` runs before the scripts of the page.
    #[must_use]
    pub fn open_beside(&self, url: &str, script: &str) -> Self {
        Self::open_in(Rc::clone(&self.browser), url, script)
    }

    fn open_in(browser: Rc<BrowserContext>, url: &str, script: &str) -> Self {
        let mut page = Self { connection: browser.open_page(), browser, heard: 0 };
        for domain in ["Page", "Log", "Network", "Runtime"] {
            page.call(&format!("{domain}.enable"), json!({}));
        }
        page.call("Emulation.setCPUThrottlingRate", json!({ "rate": variable("SLOW_PAGE").max(1) }));
        page.show_on(DESKTOP);
        for script in [KEEP_TEXTS, script] {
            page.call("Page.addScriptToEvaluateOnNewDocument", json!({ "source": script }));
        }
        page.call("Page.navigate", json!({ "url": url }));
        page.wait_until_it_draws();
        page
    }

    /// Loads the page again, and waits until it has drawn a picture.
    #[track_caller]
    pub fn reload(&mut self) {
        self.evaluate("delete window.sevenbot");
        self.call("Page.reload", json!({}));
        self.heard = 0;
        self.wait_until_it_draws();
    }

    #[track_caller]
    fn wait_until_it_draws(&mut self) {
        wait_for("the page draws", || {
            let frames = self.try_evaluate("window.sevenbot.frame_count()");
            frames
                .ok()
                .and_then(|count| count.as_u64())
                .filter(|&count| count > 2)
                .ok_or_else(|| self.report())
        });
    }

    /// Changes the screen, and waits until the page has it.
    #[track_caller]
    pub fn show_on(&mut self, screen: Screen) {
        let Screen { width, height, is_dark, is_phone } = screen;
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": is_phone });
        self.call("Emulation.setDeviceMetricsOverride", size);
        let scheme = if is_dark { "dark" } else { "light" };
        let feature = json!({ "name": "prefers-color-scheme", "value": scheme });
        self.call("Emulation.setEmulatedMedia", json!({ "features": [feature] }));
        self.call("Emulation.setTouchEmulationEnabled", json!({ "enabled": is_phone }));
        let has_it = format!("matchMedia('(width: {width}px) and (prefers-color-scheme: {scheme})').matches");
        wait_until("the page has another screen", || self.evaluate(&has_it) == true);
    }

    /// Calls a method of the DevTools protocol.
    #[track_caller]
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.connection.call(method, parameters)
    }

    /// The value of a JavaScript expression. Waits if the expression is a promise.
    ///
    /// # Errors
    /// The expression throws an exception, or the browser reports an error, for example because it left the page meanwhile.
    pub fn try_evaluate(&mut self, expression: &str) -> Result<Value, String> {
        let parameters = json!({
            "expression": format!("(async () => ({expression}))()"),
            "awaitPromise": true,
            "returnByValue": true,
        });
        let mut answer = self.connection.try_call("Runtime.evaluate", parameters)?;
        match answer.get("exceptionDetails") {
            Some(exception) => Err(exception.to_string()),
            None => Ok(answer["result"]["value"].take()),
        }
    }

    /// The value of a JavaScript expression.
    #[track_caller]
    pub fn evaluate(&mut self, expression: &str) -> Value {
        self.try_evaluate(expression).unwrap_or_else(|exception| panic!("{expression}: {exception}"))
    }

    /// As [`Self::evaluate`], for a number.
    #[track_caller]
    pub fn number(&mut self, expression: &str) -> f64 {
        let value = self.evaluate(expression);
        value.as_f64().unwrap_or_else(|| panic!("{expression} is {value}"))
    }

    /// The text of the first element that matches `selector`, and of the elements in it.
    #[track_caller]
    pub fn text(&mut self, selector: &str) -> String {
        let text = self.evaluate(&format!("document.querySelector(`{selector}`).textContent"));
        text.as_str().expect("a text").to_owned()
    }

    /// Gives an element the keyboard's focus.
    #[track_caller]
    pub fn focus(&mut self, selector: &str) {
        self.evaluate(&format!("document.querySelector(`{selector}`).focus()"));
    }

    /// The state of the page: the JSON that the page's module exports.
    #[track_caller]
    pub fn state(&mut self) -> Value {
        let text = self.evaluate("window.sevenbot.state()");
        let text = text.as_str().expect("text");
        serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }

    /// Waits until the state meets a condition. The speed of the page depends on the machine, so a test waits for states, not for
    /// times.
    #[track_caller]
    pub fn wait_for_state(&mut self, event: &str, holds: impl Fn(&Value) -> bool) -> Value {
        wait_for(event, || {
            let state = self.state();
            if holds(&state) { Ok(state) } else { Err(format!("{state}; {}", self.report())) }
        })
    }

    /// Waits until the present arm of the page answers and is ready.
    #[track_caller]
    pub fn wait_until_ready(&mut self) {
        self.wait_for_state("the arm answers", |state| state["connected"] == true);
        self.wait_for_text("#state", "The arm is ready.");
    }

    /// Waits until an element has shown a text that contains `part`, later than the text that the last call waited for. The text
    /// may be gone again.
    #[track_caller]
    pub fn wait_until_said(&mut self, selector: &str, part: &str) {
        self.heard = wait_for(&format!("{selector} has said {part}"), || {
            let said = self.evaluate("window.said");
            let said = said.as_array().expect("texts");
            let is_wanted =
                |text: &Value| text[0] == selector && text[1].as_str().is_some_and(|it| it.contains(part));
            let found = said.iter().skip(self.heard).position(is_wanted);
            found.map(|index| self.heard + index + 1).ok_or_else(|| format!("{said:?}; {}", self.report()))
        });
    }

    /// Waits until a joint has this target in degrees and rests there.
    #[track_caller]
    pub fn wait_until_joint_rests(&mut self, joint: usize, degrees: f64) {
        self.wait_until_joints_rest(&[(joint, degrees)]);
    }

    /// Waits until these joints have these targets in degrees and rest there: within 1 degree, because of their play, their
    /// friction and their load.
    #[track_caller]
    pub fn wait_until_joints_rest(&mut self, goals: &[(usize, f64)]) {
        self.wait_for_state(&format!("the joints rest at {goals:?}"), |state| {
            let is_near = |name: &str, most: f64| {
                let angle = |joint: usize| state[name][joint - 1].as_f64().unwrap_or(f64::NAN);
                goals.iter().all(|&(joint, degrees)| (angle(joint) - degrees).abs() < most)
            };
            is_near("targets", 0.01) && is_near("measured", 1.0) && state["registers"][MOVING_JOINTS] == 0
        });
        // The set-point is there. The motor needs a moment.
        self.pass(0.5);
    }

    /// Waits until the text of an element contains `part`.
    #[track_caller]
    pub fn wait_for_text(&mut self, selector: &str, part: &str) {
        wait_for(&format!("{selector} says {part}"), || {
            let text = self.text(selector);
            if text.contains(part) { Ok(()) } else { Err(format!("{text}; {}", self.report())) }
        });
    }

    /// Waits until the clock of the page's arm has advanced by this time, in seconds.
    #[track_caller]
    pub fn pass(&mut self, seconds: f64) {
        let end = self.state()["time"].as_f64().expect("a time") + seconds * 1e6;
        self.wait_for_state("time passes", |state| state["time"].as_f64() >= Some(end));
    }

    /// The measured angles of all joints, in degrees.
    #[track_caller]
    pub fn measured(&mut self) -> [f64; 7] {
        let state = self.state();
        std::array::from_fn(|joint| state["measured"][joint].as_f64().expect("an angle"))
    }

    /// The target of a joint, in degrees.
    #[track_caller]
    pub fn target(&mut self, joint: usize) -> f64 {
        self.state()["targets"][joint - 1].as_f64().expect("an angle")
    }

    /// Projects a point in mm to CSS pixels from the top left of the window.
    #[track_caller]
    pub fn project(&mut self, [x, y, z]: [f64; 3]) -> [f64; 2] {
        let place = self.evaluate(&format!("[...window.sevenbot.project({x}, {y}, {z})]"));
        [place[0].as_f64().expect("a number"), place[1].as_f64().expect("a number")]
    }

    /// A picture of the window as a PNG file.
    pub fn screenshot(&mut self) -> Vec<u8> {
        self.capture(json!({}))
    }

    fn capture(&mut self, parameters: Value) -> Vec<u8> {
        let answer = self.call("Page.captureScreenshot", parameters);
        STANDARD.decode(answer["data"].as_str().expect("base64")).expect("base64")
    }

    /// The pixels of the window.
    pub fn picture(&mut self) -> Picture {
        Picture::decode(&self.screenshot())
    }

    /// The pixels of a part of the window that begins at whole CSS pixels.
    pub fn picture_of(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2]) -> Picture {
        let clip = json!({ "x": x, "y": y, "width": width, "height": height, "scale": 1 });
        Picture::decode(&self.capture(json!({ "clip": clip })))
    }

    /// Exceptions, errors in the console, and violations of the content security policy.
    pub fn errors(&mut self) -> Vec<String> {
        self.settle();
        self.errors_so_far().map(Value::to_string).collect()
    }

    fn errors_so_far(&self) -> impl Iterator<Item = &Value> {
        self.connection.events.iter().filter_map(|event| {
            let details = &event["params"];
            match event["method"].as_str()? {
                "Runtime.exceptionThrown" => Some(details),
                "Runtime.consoleAPICalled" if details["type"] == "error" => Some(details),
                "Log.entryAdded" if details["entry"]["level"] == "error" => Some(details),
                _ => None,
            }
        })
    }

    /// The addresses of all requests since the page was opened, in order. They include those of WebSockets.
    pub fn requests(&mut self) -> Vec<String> {
        self.settle();
        let url = |event: &Value| match event["method"].as_str()? {
            "Network.requestWillBeSent" => event["params"]["request"]["url"].as_str().map(str::to_owned),
            "Network.webSocketCreated" => event["params"]["url"].as_str().map(str::to_owned),
            _ => None,
        };
        self.connection.events.iter().filter_map(url).collect()
    }

    /// Waits for the events of all that has happened.
    fn settle(&mut self) {
        // The answer arrives after the events.
        self.evaluate("new Promise(done => setTimeout(done, 100))");
    }

    /// The nodes of the accessibility tree that a screen reader sees, each with its role and name.
    pub fn accessible(&mut self) -> Vec<(String, String)> {
        let tree = self.call("Accessibility.getFullAXTree", json!({}));
        let text = |value: &Value| value["value"].as_str().unwrap_or_default().trim().to_owned();
        let nodes = tree["nodes"].as_array().expect("a tree").iter();
        let seen = nodes.filter(|node| node["ignored"] == false);
        seen.map(|node| (text(&node["role"]), text(&node["name"]))).collect()
    }

    /// Errors of the page, for the message of a failed test.
    fn report(&self) -> String {
        let errors: Vec<_> = self.errors_so_far().collect();
        format!("errors of the page: {errors:?}")
    }
}
