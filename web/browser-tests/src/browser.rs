//! Debian's Chromium, with software rendering and no way to other computers.

use std::future::Future;
use std::sync::{Mutex, MutexGuard, PoisonError};

use chromiumoxide::browser::{Browser, BrowserConfig};
use futures::StreamExt;
use system_tests::wait::TIMEOUT;
use tempfile::TempDir;
use tokio::runtime::{Builder, Runtime};

/// Beside the options that the library sets.
const OPTIONS: &[&str] = &[
    "use-angle=swiftshader",
    "enable-unsafe-swiftshader",
    "disable-quic",
    "disable-component-update",
    "hide-scrollbars",
    // The heap of a page can be measured exactly.
    "enable-precise-memory-info",
    // Names are not looked up: a request to another computer fails at once, and is in the list of requests.
    "host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
];

/// One browser at a time: it renders in software, and uses all processors.
static TURN: Mutex<()> = Mutex::new(());

/// A running browser with a profile of its own.
#[derive(Debug)]
pub struct Chromium {
    browser: Browser,
    runtime: Runtime,
    _profile: TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Chromium {
    /// Starts a browser.
    #[must_use]
    pub fn start() -> Self {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let profile = tempfile::tempdir().expect("a temporary folder");
        // Tests often run as root, who has no sandbox.
        let config = BrowserConfig::builder()
            .no_sandbox()
            .new_headless_mode()
            .viewport(None)
            .launch_timeout(TIMEOUT)
            .request_timeout(TIMEOUT)
            .user_data_dir(profile.path())
            .args(OPTIONS.iter().copied())
            .build()
            .expect("`cargo xtask test` installs chromium");
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("a thread");
        let (browser, mut messages) = runtime.block_on(Browser::launch(config)).expect("the browser starts");
        runtime.spawn(async move { while messages.next().await.is_some() {} });
        Self { browser, runtime, _profile: profile, _turn: turn }
    }

    /// An empty page.
    #[must_use]
    pub fn new_page(&self) -> chromiumoxide::Page {
        self.wait(self.browser.new_page("about:blank")).expect("a page")
    }

    /// Waits for an answer of the browser.
    pub fn wait<T>(&self, answer: impl Future<Output = T>) -> T {
        self.runtime.block_on(answer)
    }

    /// Lets something run beside the test.
    pub fn run_beside(&self, task: impl Future<Output = ()> + Send + 'static) {
        self.runtime.spawn(task);
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.runtime.block_on(self.browser.kill());
    }
}
