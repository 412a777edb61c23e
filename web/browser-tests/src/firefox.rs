//! Debian's Firefox, driven by WebDriver BiDi (a standard of the W3C).
//!
//! Without a screen this Firefox has no WebGL, so it gets a virtual screen: `Xvfb`, with OpenGL in software.

use std::fs;
use std::process::{Command, Stdio};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use system_tests::process::RunningProgram;
use system_tests::wait::wait_for;
use tempfile::TempDir;

use crate::connection::{Connection, line_after};
use crate::picture::Picture;

/// WebGL in software, and no reports to the makers of Firefox.
const PREFERENCES: &str = "\
user_pref(\"webgl.force-enabled\", true);
user_pref(\"datareporting.policy.dataSubmissionEnabled\", false);
";

/// A running browser with one page.
#[derive(Debug)]
pub struct Firefox {
    // The browser is killed before its screen.
    _browser: RunningProgram,
    _screen: RunningProgram,
    _profile: TempDir,
    /// It keeps all events: what the page logged and requested.
    session: Connection,
    /// The identifier of the page.
    context: Value,
}

impl Firefox {
    /// Starts a browser, and opens an address.
    #[must_use]
    pub fn open(url: &str) -> Self {
        let profile = tempfile::tempdir().expect("a temporary folder");
        fs::write(profile.path().join("user.js"), PREFERENCES).expect("a file");

        let mut screen = Command::new("Xvfb");
        screen.args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", "1280x800x24"]);
        let mut screen = RunningProgram::spawn(screen.stdout(Stdio::piped()).stderr(Stdio::null()));
        let display = line_after("", screen.stdout.take());

        let mut browser = Command::new("firefox-esr");
        browser.args(["--no-remote", "--remote-debugging-port", "0", "--profile"]).arg(profile.path());
        browser.env("DISPLAY", format!(":{display}")).env("HOME", profile.path());
        let mut browser = RunningProgram::spawn(browser.stdout(Stdio::null()).stderr(Stdio::piped()));
        let address = line_after("WebDriver BiDi listening on ws://", browser.stderr.take());

        let mut session = Connection::open(&format!("{address}/session"), |_| true);
        session.call("session.new", json!({ "capabilities": {} }));
        let context = session.call("browsingContext.getTree", json!({}))["contexts"][0]["context"].clone();
        let events = ["log.entryAdded", "network.beforeRequestSent"];
        session.call("session.subscribe", json!({ "events": events, "contexts": [context] }));
        session
            .call("browsingContext.navigate", json!({ "context": context, "url": url, "wait": "complete" }));
        Self { _browser: browser, _screen: screen, _profile: profile, session, context }
    }

    /// The value of a JavaScript expression. Waits if the expression is a promise.
    #[track_caller]
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let parameters = json!({
            "expression": format!("(async () => JSON.stringify(await ({expression})))()"),
            "target": { "context": self.context },
            "awaitPromise": true,
        });
        let answer = self.session.call("script.evaluate", parameters);
        assert_eq!(answer["type"], "success", "{expression}: {answer}");
        answer["result"]["value"]
            .as_str()
            .map_or(Value::Null, |text| serde_json::from_str(text).expect("JSON"))
    }

    /// Waits until an expression has a value that meets a condition.
    #[track_caller]
    pub fn wait_for(&mut self, event: &str, expression: &str, holds: impl Fn(&Value) -> bool) -> Value {
        wait_for(event, || {
            let value = self.evaluate(expression);
            if holds(&value) { Ok(value) } else { Err(format!("{value}; {:?}", self.session.events)) }
        })
    }

    /// Presses a key this number of times. `key` is its code in the WebDriver standard.
    pub fn keys(&mut self, key: char, times: usize) {
        let press = ["keyDown", "keyUp"].map(|kind| json!({ "type": kind, "value": key }));
        let actions: Vec<_> = press.iter().cycle().take(2 * times).collect();
        let keyboard = json!({ "type": "key", "id": "keyboard", "actions": actions });
        self.session.call("input.performActions", json!({ "context": self.context, "actions": [keyboard] }));
    }

    /// The pixels of the window.
    pub fn picture(&mut self) -> Picture {
        let picture =
            self.session.call("browsingContext.captureScreenshot", json!({ "context": self.context }));
        let png = STANDARD.decode(picture["data"].as_str().expect("base64")).expect("base64");
        Picture::decode(&png)
    }

    /// Exceptions of the page, and its errors in the console.
    pub fn errors(&self) -> impl Iterator<Item = &str> {
        let errors = self.session.events.iter().filter(|event| event["params"]["level"] == "error");
        errors.filter_map(|event| event["params"]["text"].as_str())
    }

    /// The addresses of all requests since the page was opened, in order.
    pub fn requests(&self) -> impl Iterator<Item = &str> {
        self.session.events.iter().filter_map(|event| event["params"]["request"]["url"].as_str())
    }
}
