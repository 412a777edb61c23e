//! `sevenbot view`, with or without a simulated arm behind it.

use std::path::PathBuf;
use std::process::Command;

use system_tests::process::{self, RunningProgram};
use system_tests::programs::{host_sim, tool};
use system_tests::wait::wait_for;
use tempfile::TempDir;

use crate::page::Page;

/// A running server of the page.
#[derive(Debug)]
pub struct Viewed {
    server: Option<RunningProgram>,
    _simulator: Option<RunningProgram>,
    /// The address to open, with its token if there is an arm.
    pub url: String,
    folder: TempDir,
}

impl Viewed {
    /// Starts the server without an arm: the page simulates one.
    #[must_use]
    pub fn without_arm() -> Self {
        Self::start(false, &[])
    }

    /// Starts the server with an arm of `host-sim`.
    #[must_use]
    pub fn with_arm() -> Self {
        Self::start(true, &[])
    }

    /// Starts the server with an arm of `host-sim` that the page cannot move.
    #[must_use]
    pub fn read_only() -> Self {
        Self::start(true, &["--read-only"])
    }

    /// Kills the server, so that the page loses its line to the arm.
    pub fn end_server(&mut self) {
        self.server = None;
    }

    fn start(has_arm: bool, options: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let simulator = has_arm.then(|| simulator(&folder));
        let mut command = tool();
        command.current_dir(&folder);
        let arm: &[&str] = if has_arm { &["--port", "./arm"] } else { &["--simulate"] };
        command.args(["view", "--no-open", "--http", "0"]).args(arm).args(options);
        let (server, addresses) = process::start(&mut command, 1).expect("the server is ready");
        let url = addresses.first().expect("an address").display().to_string();
        Self { server: Some(server), _simulator: simulator, url, folder }
    }

    /// Opens the page, ends its tour, and waits until an arm answers.
    #[must_use]
    pub fn open(&self) -> Page {
        self.open_after("")
    }

    /// As [`Self::open`]. `script` runs before the scripts of the page.
    #[must_use]
    pub fn open_after(&self, script: &str) -> Page {
        let mut page = Page::open_after(&self.url, script);
        page.key("Escape");
        page.wait_until_ready();
        page
    }

    /// A file in the folder of this server.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A command that runs `sevenbot` in the folder of this server, where `./arm` is the port of the arm.
    #[must_use]
    pub fn tool(&self) -> Command {
        let mut command = tool();
        command.current_dir(&self.folder);
        command
    }

    /// Begins a movement of joint 1 with this action, ends it by `sevenbot stop`, and waits until the page says so. On a busy
    /// machine the page may pause for a second, or miss replies. This ends a movement, too, and the test begins the movement again.
    ///
    /// # Panics
    /// The movement ends for another reason, or the page is late each time.
    pub fn stop_by_another_program(&self, page: &mut Page, action: &str) {
        for _ in 0..10 {
            page.click(&format!("[data-action={action}]"));
            let start = page.measured()[0];
            wait_for("joint 1 turns", || {
                let (measured, notice) = (page.measured()[0], page.text("#notice"));
                if measured > start + 1.0 || notice.contains("ended early") {
                    Ok(())
                } else {
                    Err(format!("{measured} {notice}"))
                }
            });
            let stop = self.tool().args(["stop", "--port", "./arm"]).output().expect("it runs");
            assert!(stop.status.success(), "{stop:?}");
            let notice = wait_for("the movement ends", || {
                let notice = page.text("#notice");
                if notice.contains("ended early") { Ok(notice) } else { Err(notice) }
            });
            if notice.contains("Another program has stopped the arm.") {
                return;
            }
            let is_late =
                ["did not run for a while", "does not answer"].iter().any(|part| notice.contains(part));
            assert!(is_late, "{notice}");
        }
        panic!("the page is late each time");
    }

    /// The address without path and token.
    #[must_use]
    pub fn origin(&self) -> &str {
        self.url.split("/?").next().unwrap_or_default().trim_end_matches('/')
    }
}

pub(crate) fn simulator(folder: &TempDir) -> RunningProgram {
    let mut command = Command::new(host_sim());
    command.args(["--quiet", "--eeprom", "none", "--link"]).arg(folder.path().join("arm"));
    process::start(&mut command, 1).expect("the simulator is ready").0
}
