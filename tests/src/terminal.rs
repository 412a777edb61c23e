//! A terminal with a program in it: keys in, and what its screen shows.

use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::path::Path;
use std::process::{Child, ExitStatus};
use std::sync::{Arc, Mutex};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use pty_process::Size;
use pty_process::blocking::{Command, Pty, open};
use vt100::Parser;

use crate::line::PATIENCE;
use crate::programs::TOOL_TIMEOUT;

/// The size of every terminal here: what everybody has at least.
const ROWS: NonZeroU16 = NonZeroU16::new(24).unwrap();
const COLUMNS: NonZeroU16 = NonZeroU16::new(80).unwrap();
/// Time between two looks at a screen.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// A terminal, and the program that runs in it. Both go together.
pub struct Terminal {
    pty: Arc<Pty>,
    screen: Arc<Mutex<Parser>>,
    program: Child,
}

impl Terminal {
    /// Runs a program in a terminal of 24 rows and 80 columns.
    #[must_use]
    pub fn run(program: &Path, arguments: &[&str]) -> Self {
        let (pty, terminal) = open().expect("a pseudo-terminal");
        pty.resize(Size::new(ROWS.get(), COLUMNS.get())).expect("a size");
        let command = Command::new(program).args(arguments).env("TERM", "xterm-256color");
        let command = command.env(TOOL_TIMEOUT.0, TOOL_TIMEOUT.1);
        let program = command.spawn(terminal).expect("the program starts");
        let screen = Arc::new(Mutex::new(Parser::new(ROWS, COLUMNS, 0)));
        let (pty, painter) = (Arc::new(pty), Arc::clone(&screen));
        let output = Arc::clone(&pty);
        thread::spawn(move || {
            let mut chunk = [0; 4096];
            // An error is how a pseudo-terminal says that nobody is on its other side any more.
            while let Ok(length @ 1..) = (&*output).read(&mut chunk) {
                painter.lock().expect("a screen").process(&chunk[..length]);
            }
        });
        Self { pty, screen, program }
    }

    /// Types.
    pub fn keys(&self, keys: &str) {
        (&*self.pty).write_all(keys.as_bytes()).expect("the terminal takes keys");
    }

    /// What the screen shows, row by row.
    #[must_use]
    pub fn shows(&self) -> String {
        self.screen.lock().expect("a screen").screen().contents()
    }

    /// Is the program drawing on a screen of its own, which leaves what was there before untouched?
    #[must_use]
    pub fn is_on_own_screen(&self) -> bool {
        self.screen.lock().expect("a screen").screen().alternate_screen()
    }

    /// Waits until the screen shows a text, and gives all that it shows.
    #[track_caller]
    pub fn wait_for(&self, text: &str) -> String {
        self.wait_until(text, |screen| screen.contains(text))
    }

    /// Waits until the screen shows what is wanted.
    #[track_caller]
    pub fn wait_until(&self, what: &str, is_shown: impl Fn(&str) -> bool) -> String {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let screen = self.shows();
            if is_shown(&screen) {
                return screen;
            }
            assert!(Instant::now() < deadline, "waited in vain for {what}; the screen shows:\n{screen}");
            sleep(LOOK_EVERY);
        }
    }

    /// Waits until the program has ended.
    #[track_caller]
    pub fn wait(&mut self) -> ExitStatus {
        let deadline = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.program.try_wait().expect("a program to wait for") {
                return status;
            }
            assert!(Instant::now() < deadline, "it does not end; the screen shows:\n{}", self.shows());
            sleep(LOOK_EVERY);
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // Errors mean that it has ended already.
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}
