//! A client of the control socket of a simulator.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

use serde_json::{Value, json};

/// A connection to a control socket.
#[derive(Debug)]
pub struct Control(BufReader<UnixStream>);

impl Control {
    /// Connects to the socket at this path.
    #[must_use]
    pub fn connect(path: &Path) -> Self {
        Self(BufReader::new(UnixStream::connect(path).expect("a control socket")))
    }

    /// Sends bytes, which need not be a request.
    pub fn send(&mut self, bytes: &[u8]) {
        self.0.get_mut().write_all(bytes).expect("it accepts bytes");
    }

    /// Waits for the next answer: one line of JSON.
    pub fn answer(&mut self) -> Value {
        let mut line = String::new();
        self.0.read_line(&mut line).expect("an answer");
        serde_json::from_str(&line).expect("JSON")
    }

    /// Sends a request and returns its answer, which may be an error.
    pub fn ask(&mut self, request: &Value) -> Value {
        self.send(format!("{request}\n").as_bytes());
        self.answer()
    }

    /// Sends a request and returns its result. Panics if the answer is an error.
    #[track_caller]
    pub fn result(&mut self, request: &Value) -> Value {
        let mut answer = self.ask(request);
        assert!(answer["error"].is_null(), "{request}: {answer}");
        answer["ok"].take()
    }

    /// Lets virtual time pass as fast as possible.
    pub fn advance(&mut self, milliseconds: u64) {
        self.result(&json!({ "do": "advance", "ms": milliseconds }));
    }
}
