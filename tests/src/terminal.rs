//! A terminal with a program: key strokes in, the contents of the screen out.

use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::path::Path;
use std::process::ExitStatus;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use pty_process::Size;
use pty_process::blocking::{Command, Pty, open};
use vt100::Parser;

use crate::process::RunningProgram;
use crate::programs::TOOL_TIMEOUT;
use crate::wait::wait_for;

/// The size of a usual terminal.
const ROWS: NonZeroU16 = NonZeroU16::new(24).unwrap();
const COLUMNS: NonZeroU16 = NonZeroU16::new(80).unwrap();

/// A terminal and its program, which is killed when the terminal is dropped.
pub struct Terminal {
    pty: Arc<Pty>,
    screen: Arc<Mutex<Parser>>,
    /// All bytes that the program has written.
    output: Arc<Mutex<Vec<u8>>>,
    program: RunningProgram,
    /// Draws the output on the screen, until the program has ended.
    painter: Option<JoinHandle<()>>,
}

impl Terminal {
    /// Runs a program in a terminal of 24 rows and 80 columns.
    #[must_use]
    pub fn run(program: &Path, arguments: &[&str]) -> Self {
        let (pty, terminal) = open().expect("a pseudo-terminal");
        pty.resize(Size::new(ROWS.get(), COLUMNS.get())).expect("a size");
        let command = Command::new(program).args(arguments).env("TERM", "xterm-256color");
        let command = command.env(TOOL_TIMEOUT.0, TOOL_TIMEOUT.1);
        let program = command.spawn(terminal).expect("the program starts").into();
        let screen = Arc::new(Mutex::new(Parser::new(ROWS, COLUMNS, 0)));
        let output = Arc::new(Mutex::new(Vec::new()));
        let (drawn, written) = (Arc::clone(&screen), Arc::clone(&output));
        let pty = Arc::new(pty);
        let source = Arc::clone(&pty);
        let painter = thread::spawn(move || {
            let mut chunk = [0; 4096];
            // A pseudo-terminal returns an error when its program has ended.
            while let Ok(length @ 1..) = (&*source).read(&mut chunk) {
                drawn.lock().expect("a screen").process(&chunk[..length]);
                written.lock().expect("the output").extend_from_slice(&chunk[..length]);
            }
        });
        Self { pty, screen, output, program, painter: Some(painter) }
    }

    /// Types keys: their characters, such as `\r` for Enter.
    pub fn keys(&self, keys: &str) {
        (&*self.pty).write_all(keys.as_bytes()).expect("the terminal takes keys");
    }

    /// The contents of the screen, row by row.
    #[must_use]
    pub fn contents(&self) -> String {
        self.screen.lock().expect("a screen").screen().contents()
    }

    /// All bytes that the program has written.
    #[must_use]
    pub fn output(&self) -> Vec<u8> {
        self.output.lock().expect("the output").clone()
    }

    /// True if the program draws on the alternate screen, which does not change the normal one.
    #[must_use]
    pub fn is_on_alternate_screen(&self) -> bool {
        self.screen.lock().expect("a screen").screen().alternate_screen()
    }

    /// Waits until the screen contains a text, and returns its contents.
    #[track_caller]
    pub fn wait_for(&self, text: &str) -> String {
        self.wait_until(text, |screen| screen.contains(text))
    }

    /// Waits for a condition on the contents of the screen, and returns them.
    #[track_caller]
    pub fn wait_until(&self, condition: &str, holds: impl Fn(&str) -> bool) -> String {
        wait_for(condition, || {
            let contents = self.contents();
            if holds(&contents) { Ok(contents) } else { Err(format!("the screen shows:\n{contents}")) }
        })
    }

    /// Waits for the end of the program, and until its output is on the screen.
    #[track_caller]
    pub fn wait(&mut self) -> ExitStatus {
        let status = wait_for("the program ends", || {
            let status = self.program.try_wait().expect("a program to wait for");
            status.ok_or_else(|| format!("the screen shows:\n{}", self.contents()))
        });
        self.painter.take().map(JoinHandle::join);
        status
    }
}

/// What a terminal shows after these bytes.
#[must_use]
pub fn picture(output: &[u8]) -> String {
    let mut screen = Parser::new(ROWS, COLUMNS, 0);
    screen.process(output);
    screen.screen().contents()
}
