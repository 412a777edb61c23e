//! `sevenbot class` on this computer, with or without a simulated arm in the place of the real one.

use std::path::PathBuf;

use system_tests::process::{self, RunningProgram};
use system_tests::programs::tool;
use tempfile::TempDir;

use crate::page::Page;
use crate::viewed::simulator;

/// A class on this computer. Dropping it ends its programs.
#[derive(Debug)]
pub struct ClassRun {
    _server: RunningProgram,
    _simulator: Option<RunningProgram>,
    /// The address that pupils open.
    pub pupils: String,
    /// The address of the teacher's screen.
    pub teacher: String,
    folder: TempDir,
}

impl ClassRun {
    /// Starts a class whose code is `robots7`. With `has_arm`, a simulated arm takes the place of the class's real arm.
    #[must_use]
    pub fn start(has_arm: bool) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let simulator = has_arm.then(|| simulator(&folder));
        let mut command = tool();
        command.current_dir(&folder).env("XDG_RUNTIME_DIR", folder.path());
        if has_arm {
            command.args(["--port", "./arm"]);
        }
        command.args(["class", "--no-open", "--http", "0", "--code", "robots7"]);
        let (server, pages) = process::start(&mut command, 2).expect("the class is ready");
        let [pupils, teacher] = [0, 1].map(|page: usize| pages[page].display().to_string());
        Self { _server: server, _simulator: simulator, pupils, teacher, folder }
    }

    /// Opens the teacher's screen in a new browser context.
    #[must_use]
    pub fn open_teacher(&self) -> Page {
        Page::open(&self.teacher)
    }

    /// Opens a pupil's page in the browser context of another page, and joins the class with this name.
    #[must_use]
    pub fn join(&self, beside: &Page, name: &str) -> Page {
        self.join_after(beside, name, "")
    }

    /// As [`Self::join`]. `script` runs before the scripts of the page.
    #[must_use]
    pub fn join_after(&self, beside: &Page, name: &str, script: &str) -> Page {
        let mut page = beside.open_beside(&self.pupils, script);
        page.key("Escape");
        page.wait_until_ready();
        page.evaluate("document.querySelector('#class-code').value = 'robots7'");
        page.type_into("#class-name", name);
        page.wait_for_text("#class-state", "You are in the class as");
        page
    }

    /// A file in the folder of this class.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}
