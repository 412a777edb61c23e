//! A connection to a browser: calls in JSON on a WebSocket, and the events between their answers.
//!
//! The DevTools protocol of Chromium and WebDriver BiDi share this form.

use std::net::TcpStream;
use std::thread;
use std::time::Duration;

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};
use system_tests::process;
use system_tests::wait::TIMEOUT;
use tungstenite::{Message, WebSocket};

/// A connection to a browser or to one of its pages.
#[derive(Debug)]
pub struct Connection {
    socket: WebSocket<TcpStream>,
    /// For the delays of `LATE_TEST`.
    random: Xoshiro256PlusPlus,
    last_id: u64,
    /// The session of the DevTools protocol that calls belong to; `None` for calls to the browser itself.
    pub session: Option<String>,
    /// The events that are kept, in order.
    pub events: Vec<Value>,
    is_kept: fn(&Value) -> bool,
}

impl Connection {
    /// Connects to an address without its `ws://`, and keeps the events for which `is_kept` holds.
    #[must_use]
    pub fn open(address: &str, is_kept: fn(&Value) -> bool) -> Self {
        let host = address.split('/').next().unwrap_or_default();
        let stream = TcpStream::connect(host).expect("a connection");
        stream.set_read_timeout(Some(TIMEOUT)).expect("a timeout");
        let (socket, _) = tungstenite::client(format!("ws://{address}"), stream).expect("a WebSocket");
        let random = Xoshiro256PlusPlus::seed_from_u64(std::process::id().into());
        Self { socket, random, last_id: 0, session: None, events: Vec::new(), is_kept }
    }

    /// Calls a method of the protocol.
    ///
    /// # Errors
    /// The answer of the browser, if it reports an error.
    pub fn try_call(&mut self, method: &str, parameters: Value) -> Result<Value, String> {
        thread::sleep(Duration::from_millis(self.random.next_u64() % (variable("LATE_TEST") + 1)));
        self.last_id += 1;
        let mut request = json!({ "id": self.last_id, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            request["sessionId"] = json!(session);
        }
        self.socket.send(Message::text(request.to_string())).expect("the browser listens");
        loop {
            let message = self.socket.read().expect("the browser answers");
            let mut message: Value = serde_json::from_slice(&message.into_data()).expect("JSON");
            if message["id"] == self.last_id {
                let is_error = message.get("error").is_some();
                return if is_error {
                    Err(format!("{method}: {message}"))
                } else {
                    Ok(message["result"].take())
                };
            }
            if (self.is_kept)(&message) {
                self.events.push(message);
            }
        }
    }

    /// Calls a method, which must succeed.
    #[track_caller]
    pub fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.try_call(method, parameters).unwrap_or_else(|error| panic!("{error}"))
    }
}

/// The number in an environment variable; 0 if the variable is not set or holds no number.
pub(crate) fn variable(name: &str) -> u64 {
    std::env::var(name).ok().and_then(|number| number.parse().ok()).unwrap_or(0)
}

/// Waits for the first line that begins with `beginning`, and returns the rest of that line.
#[track_caller]
pub(crate) fn line_after(beginning: &str, output: Option<impl std::io::Read + Send + 'static>) -> String {
    let lines = process::lines(output.expect("a pipe"));
    loop {
        let line = lines.recv_timeout(TIMEOUT).expect("a line");
        if let Some(rest) = line.strip_prefix(beginning) {
            return rest.to_owned();
        }
    }
}
