//! Debian's Chromium, with software rendering and without connections to other computers.

use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};

use crate::connection::{Connection, line_after};

/// Software rendering at full speed, also of a hidden window; no questions to a user, and no connections to other computers.
const OPTIONS: &[&str] = &[
    "--headless=new",
    "--remote-debugging-port=0",
    // Tests often run as root. Chromium does not run as root with its sandbox.
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

/// Only events of these methods are kept. The page of a served arm causes many others.
const KEPT: [&str; 5] = [
    "Network.requestWillBeSent",
    "Network.webSocketCreated",
    "Runtime.exceptionThrown",
    "Runtime.consoleAPICalled",
    "Log.entryAdded",
];

/// Starts the browser with a new profile, and ends it when the standard input is closed. The input is closed at the latest when
/// the process of the tests ends, also if it is killed.
const RUN: &str = r#"
    profile=$(mktemp -d)
    chromium --user-data-dir="$profile" "$@" &
    read -r _
    kill $!
    wait
    rm -r "$profile""#;

/// The browser of this process, which is started for the first test. It renders in software and uses all processors, so one test at
/// a time has it.
static BROWSER: Mutex<Option<Chromium>> = Mutex::new(None);

#[derive(Debug)]
struct Chromium {
    /// The address of its DevTools, without `ws://`.
    address: String,
    /// The shell, with its standard input.
    _process: Child,
}

impl Chromium {
    fn start() -> Self {
        let mut command = Command::new("sh");
        command.args(["-c", RUN, "sh"]).args(OPTIONS).stdin(Stdio::piped());
        let mut process = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("a shell");
        let address = line_after("DevTools listening on ws://", process.stderr.take());
        Self { address, _process: process }
    }
}

/// The browser for one test: without windows, files and stored values of other tests.
#[derive(Debug)]
pub struct BrowserContext {
    address: String,
    /// Its identifier in the DevTools protocol.
    pub id: Value,
    // The order of these fields matters: the connection closes, and with it the windows, before another test has the browser.
    _lasts_as_long_as: Connection,
    _turn: MutexGuard<'static, Option<Chromium>>,
}

impl BrowserContext {
    /// Waits until no other test has the browser, starts the browser if it does not run yet, and creates a context.
    #[must_use]
    pub fn open() -> Self {
        let mut turn = BROWSER.lock().unwrap_or_else(PoisonError::into_inner);
        let address = turn.get_or_insert_with(Chromium::start).address.clone();
        let mut connection = Connection::open(&address, |_| false);
        let mut context = connection.call("Target.createBrowserContext", json!({ "disposeOnDetach": true }));
        let id = context["browserContextId"].take();
        Self { address, id, _lasts_as_long_as: connection, _turn: turn }
    }

    /// Opens an empty page in a window of its own, so that it is not in the background.
    #[must_use]
    pub fn open_page(&self) -> Connection {
        let is_kept = |event: &Value| KEPT.iter().any(|method| event["method"] == *method);
        let mut page = Connection::open(&self.address, is_kept);
        let window = json!({ "url": "about:blank", "newWindow": true, "browserContextId": self.id });
        let target = page.call("Target.createTarget", window);
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let session = page.call("Target.attachToTarget", attach);
        page.session = session["sessionId"].as_str().map(str::to_owned);
        page
    }
}
