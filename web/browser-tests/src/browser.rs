//! Debian's Chromium, with software rendering and no way to other computers.

use std::process::{Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};
use system_tests::process::RunningProgram;
use tempfile::TempDir;

use crate::connection::{Connection, line_after};

/// Software rendering at full speed, also of a hidden window; no questions to a user, and no connections to other computers.
const OPTIONS: &[&str] = &[
    "--headless=new",
    "--remote-debugging-port=0",
    // Tests often run as root, who has no sandbox.
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--enable-automation",
    "--no-first-run",
    "--password-store=basic",
    "--lang=en_US",
    "--force-color-profile=srgb",
    "--hide-scrollbars",
    "--mute-audio",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-timer-throttling",
    "--disable-backgrounding-occluded-windows",
    "--disable-renderer-backgrounding",
    "--disable-ipc-flooding-protection",
    "--disable-hang-monitor",
    "--disable-breakpad",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-quic",
    "--disable-sync",
    "--metrics-recording-only",
    // The heap of a page can be measured exactly.
    "--enable-precise-memory-info",
    // Names are not looked up: a request to another computer fails at once, and is in the list of requests.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
];

/// Events of these methods are kept. A served arm sends a thousand others.
const KEPT: [&str; 5] = [
    "Network.requestWillBeSent",
    "Network.webSocketCreated",
    "Runtime.exceptionThrown",
    "Runtime.consoleAPICalled",
    "Log.entryAdded",
];

/// One browser at a time: it renders in software, and uses all processors.
static TURN: Mutex<()> = Mutex::new(());

/// A running browser with a profile of its own.
#[derive(Debug)]
pub struct Chromium {
    /// Where its DevTools listen, without `ws://`.
    address: String,
    _process: RunningProgram,
    _profile: TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Chromium {
    /// Starts a browser, which has no window.
    #[must_use]
    pub fn start() -> Self {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let profile = tempfile::tempdir().expect("a temporary folder");
        let mut command = Command::new("chromium");
        command.args(OPTIONS).arg(format!("--user-data-dir={}", profile.path().display()));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut process = RunningProgram::spawn(&mut command);
        let address = line_after("DevTools listening on ws://", process.stderr.take());
        Self { address, _process: process, _profile: profile, _turn: turn }
    }

    /// Opens an empty page in a window of its own, so that it is not in the background.
    #[must_use]
    pub fn open_page(&self) -> Connection {
        let is_kept = |event: &Value| KEPT.iter().any(|method| event["method"] == *method);
        let mut page = Connection::open(&self.address, is_kept);
        let target = page.call("Target.createTarget", json!({ "url": "about:blank", "newWindow": true }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let session = page.call("Target.attachToTarget", attach);
        page.session = session["sessionId"].as_str().map(str::to_owned);
        page
    }
}
