//! A page in the browser: its values, its pictures, its faults and what it requested.

use std::sync::{Arc, Mutex, PoisonError};

use chromiumoxide::cdp::browser_protocol::accessibility::{AxValue, GetFullAxTreeParams};
use chromiumoxide::cdp::browser_protocol::emulation::{
    MediaFeature, SetDeviceMetricsOverrideParams, SetEmulatedMediaParams, SetTouchEmulationEnabledParams,
};
use chromiumoxide::cdp::browser_protocol::log::{EventEntryAdded, LogEntryLevel};
use chromiumoxide::cdp::browser_protocol::network::{EventRequestWillBeSent, EventWebSocketCreated};
use chromiumoxide::cdp::browser_protocol::page::{CaptureScreenshotParams, Viewport};
use chromiumoxide::cdp::js_protocol::runtime::{
    ConsoleApiCalledType, EvaluateParams, EventConsoleApiCalled, EventExceptionThrown,
};
use chromiumoxide::cdp::{IntoEventKind, browser_protocol::log};
use chromiumoxide::types::Command;
use futures::StreamExt;
use serde_json::Value;
use system_tests::wait::wait_for;

use crate::browser::Chromium;
use crate::picture::Picture;

/// An open page.
#[derive(Debug)]
pub struct Page {
    page: chromiumoxide::Page,
    browser: Chromium,
    /// Exceptions, errors in the console, and violations of the content security policy.
    errors: List,
    /// The addresses of all requests.
    requests: List,
}

type List = Arc<Mutex<Vec<String>>>;

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
/// The same with dark colours.
pub const DARK: Screen = Screen { is_dark: true, ..DESKTOP };
/// A phone.
pub const PHONE: Screen = Screen { width: 390, height: 844, is_dark: false, is_phone: true };

impl Page {
    /// Opens an address on a desktop, and waits until the page has drawn a picture.
    #[must_use]
    pub fn open(url: &str) -> Self {
        Self::open_after(url, "")
    }

    /// The same, after a script that runs before those of the page.
    #[must_use]
    pub fn open_after(url: &str, script: &str) -> Self {
        let browser = Chromium::start();
        let page = browser.new_page();
        let mut page = Self { page, browser, errors: List::default(), requests: List::default() };
        page.call(log::EnableParams::default());
        page.listen();
        page.show_on(DESKTOP);
        if !script.is_empty() {
            page.browser.wait(page.page.evaluate_on_new_document(script)).expect("a script");
        }
        page.browser.wait(page.page.goto(url)).expect("an answer");
        wait_for("the page draws", || {
            let frames = page.try_evaluate("window.sevenbot.frame_count()");
            frames
                .ok()
                .and_then(|count| count.as_u64())
                .filter(|&count| count > 2)
                .ok_or_else(|| page.report())
        });
        page
    }

    fn listen(&self) {
        self.keep(&self.requests, |event: &EventRequestWillBeSent| Some(event.request.url.clone()));
        self.keep(&self.requests, |event: &EventWebSocketCreated| Some(event.url.clone()));
        self.keep(&self.errors, |event: &EventExceptionThrown| {
            Some(format!("{:?}", event.exception_details))
        });
        self.keep(&self.errors, |event: &EventEntryAdded| {
            (event.entry.level == LogEntryLevel::Error).then(|| format!("{:?}", event.entry))
        });
        self.keep(&self.errors, |event: &EventConsoleApiCalled| {
            (event.r#type == ConsoleApiCalledType::Error).then(|| format!("{:?}", event.args))
        });
    }

    /// Adds what `text` says of each event to a list.
    fn keep<E: IntoEventKind + Send + Sync + Unpin>(
        &self,
        list: &List,
        text: impl Fn(&E) -> Option<String> + Send + 'static,
    ) {
        let mut events = self.browser.wait(self.page.event_listener::<E>()).expect("events");
        let list = Arc::clone(list);
        self.browser.run_beside(async move {
            while let Some(event) = events.next().await {
                list.lock().unwrap_or_else(PoisonError::into_inner).extend(text(&event));
            }
        });
    }

    /// Changes the screen.
    pub fn show_on(&mut self, screen: Screen) {
        let Screen { width, height, is_dark, is_phone } = screen;
        self.call(SetDeviceMetricsOverrideParams::new(i64::from(width), i64::from(height), 1.0, is_phone));
        let scheme = if is_dark { "dark" } else { "light" };
        let feature = MediaFeature::new("prefers-color-scheme", scheme);
        self.call(SetEmulatedMediaParams::builder().feature(feature).build());
        self.call(SetTouchEmulationEnabledParams::new(is_phone));
    }

    /// Calls a method of the DevTools protocol.
    #[track_caller]
    pub fn call<C: Command>(&mut self, command: C) -> C::Response {
        self.browser.wait(self.page.execute(command)).expect("the browser does it").result
    }

    /// The value of a JavaScript expression, which may wait.
    ///
    /// # Errors
    /// The exception.
    pub fn try_evaluate(&mut self, expression: &str) -> Result<Value, String> {
        let parameters = EvaluateParams::builder()
            .expression(format!("(async () => ({expression}))()"))
            .await_promise(true)
            .return_by_value(true)
            .build()
            .expect("an expression");
        let answer = self.call(parameters);
        match answer.exception_details {
            Some(exception) => Err(format!("{exception:?}")),
            None => Ok(answer.result.value.unwrap_or_default()),
        }
    }

    /// The value of a JavaScript expression.
    #[track_caller]
    pub fn evaluate(&mut self, expression: &str) -> Value {
        self.try_evaluate(expression).unwrap_or_else(|exception| panic!("{expression}: {exception}"))
    }

    /// The same, for a number.
    #[track_caller]
    pub fn number(&mut self, expression: &str) -> f64 {
        let value = self.evaluate(expression);
        value.as_f64().unwrap_or_else(|| panic!("{expression} is {value}"))
    }

    /// The text of an element.
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

    /// What the page knows of the arm.
    #[track_caller]
    pub fn state(&mut self) -> Value {
        let text = self.evaluate("window.sevenbot.state()");
        let text = text.as_str().expect("text");
        serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }

    /// Waits until the state meets a condition. The page's time depends on the machine, so a test has no other clock.
    #[track_caller]
    pub fn wait_for_state(&mut self, event: &str, holds: impl Fn(&Value) -> bool) -> Value {
        wait_for(event, || {
            let state = self.state();
            if holds(&state) { Ok(state) } else { Err(format!("{state}; {}", self.report())) }
        })
    }

    /// Waits until the arm that the page has now answers, and nothing is wrong with it.
    #[track_caller]
    pub fn wait_until_ready(&mut self) {
        self.wait_for_state("the arm answers", |state| state["connected"] == true);
        self.wait_for_text("#state", "The arm is ready.");
    }

    /// Waits until an element has a text.
    #[track_caller]
    pub fn wait_for_text(&mut self, selector: &str, part: &str) {
        wait_for(&format!("{selector} says {part}"), || {
            let text = self.text(selector);
            if text.contains(part) { Ok(()) } else { Err(format!("{text}; {}", self.report())) }
        });
    }

    /// Lets this much time pass for the arm of the page, in seconds.
    #[track_caller]
    pub fn pass(&mut self, seconds: f64) {
        let end = self.state()["time"].as_f64().expect("a time") + seconds * 1e6;
        self.wait_for_state("time passes", |state| state["time"].as_f64() >= Some(end));
    }

    /// The same angle of all joints: 0 measured, 1 targets, in degrees.
    #[track_caller]
    pub fn measured(&mut self) -> [f64; 7] {
        let state = self.state();
        std::array::from_fn(|joint| state["measured"][joint].as_f64().expect("an angle"))
    }

    /// Where a point in mm is drawn, in CSS pixels from the top left of the window.
    #[track_caller]
    pub fn project(&mut self, [x, y, z]: [f64; 3]) -> [f64; 2] {
        let place = self.evaluate(&format!("[...window.sevenbot.project({x}, {y}, {z})]"));
        [place[0].as_f64().expect("a number"), place[1].as_f64().expect("a number")]
    }

    /// A picture of the window as a PNG file.
    pub fn screenshot(&mut self) -> Vec<u8> {
        self.browser
            .wait(self.page.screenshot(chromiumoxide::page::ScreenshotParams::default()))
            .expect("a picture")
    }

    /// The pixels of the window.
    pub fn picture(&mut self) -> Picture {
        Picture::decode(&self.screenshot())
    }

    /// The pixels of a part of the window that begins at whole CSS pixels.
    pub fn picture_of(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2]) -> Picture {
        let clip = Viewport { x, y, width, height, scale: 1.0 };
        let parameters = CaptureScreenshotParams::builder().clip(clip).build();
        let picture = self.browser.wait(self.page.screenshot(parameters)).expect("a picture");
        Picture::decode(&picture)
    }

    /// Exceptions, errors in the console, and violations of the content security policy.
    pub fn errors(&mut self) -> Vec<String> {
        self.settled(&Arc::clone(&self.errors))
    }

    /// The addresses of all requests.
    pub fn requests(&mut self) -> Vec<String> {
        self.settled(&Arc::clone(&self.requests))
    }

    /// A list, with the events that came before this call.
    fn settled(&mut self, list: &List) -> Vec<String> {
        // The answer comes behind the events.
        self.evaluate("new Promise(done => setTimeout(done, 100))");
        list.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The nodes of the accessibility tree that a screen reader sees, each with its role and name.
    pub fn accessible(&mut self) -> Vec<(String, String)> {
        let tree = self.call(GetFullAxTreeParams::default());
        let text = |value: &Option<AxValue>| {
            let value = value.as_ref().and_then(|value| value.value.as_ref()?.as_str());
            value.unwrap_or_default().trim().to_owned()
        };
        let seen = tree.nodes.iter().filter(|node| !node.ignored);
        seen.map(|node| (text(&node.role), text(&node.name))).collect()
    }

    /// Errors of the page, for the message of a failed test.
    fn report(&self) -> String {
        format!("errors of the page: {:?}", self.errors.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
