//! A running `sevenbot class`, and its tabs. Each tab is a WebSocket without a browser.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread;
use std::time::Duration;

use serde_json::{Value, json};
use system_tests::process::{self, RunningProgram};
use system_tests::programs::tool;
use system_tests::wait::{TIMEOUT, wait_for};
use tempfile::TempDir;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Error, Message, WebSocket};

use super::served::simulator;

/// How long a tab waits for a message before it checks whether the test has one to send.
const PIECE: Duration = Duration::from_millis(10);

/// A class on this computer, perhaps with a simulated arm in the place of the real one.
pub(crate) struct Class {
    _server: RunningProgram,
    _simulator: Option<RunningProgram>,
    /// Such as `127.0.0.1:40000`.
    pub(crate) address: String,
    pub(crate) secret: String,
    code: String,
    _folder: TempDir,
}

impl Class {
    /// Starts a class, without a code if `code` is empty. Needs a `sevenbot` that was built with the page.
    pub(crate) fn start(has_arm: bool, code: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let simulator = has_arm.then(|| simulator(folder.path()));
        let mut command = tool();
        command.current_dir(&folder).env("XDG_RUNTIME_DIR", folder.path());
        if has_arm {
            command.args(["--port", "./arm"]);
        }
        command.args(["class", "--no-open", "--http", "0"]);
        if !code.is_empty() {
            command.args(["--code", code]);
        }
        let (server, pages) = process::start(&mut command, 2)
            .unwrap_or_else(|line| panic!("{line}: build the page with `cargo xtask web`, then `sevenbot`"));
        let [pupils, teacher] = [0, 1].map(|page: usize| pages[page].to_str().expect("an address"));
        let address = pupils.trim_start_matches("http://").trim_end_matches('/').to_owned();
        let (page, secret) = teacher.split_once("?token=").expect("a secret");
        assert_eq!(page, format!("http://{address}/teacher.html"));
        let (secret, code) = (secret.to_owned(), code.to_owned());
        Self { _server: server, _simulator: simulator, address, secret, code, _folder: folder }
    }

    pub(crate) fn stream(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).expect("a connection");
        stream.set_nodelay(true).expect("an option");
        stream.set_read_timeout(Some(TIMEOUT)).expect("a timeout");
        stream
    }

    /// The whole answer to a request.
    pub(crate) fn get(&self, path: &str, host: &str) -> String {
        let mut stream = self.stream();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").expect("a request");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("an answer");
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// Opens a WebSocket. The error is the HTTP status.
    pub(crate) fn socket(
        &self,
        path: &str,
        headers: &[(&'static str, &str)],
    ) -> Result<WebSocket<TcpStream>, u16> {
        let mut request = format!("ws://{}{path}", self.address).into_client_request().expect("a request");
        for (name, value) in headers {
            request.headers_mut().insert(*name, HeaderValue::from_str(value).expect("a header"));
        }
        match tungstenite::client(request, self.stream()) {
            Ok((socket, _)) => Ok(socket),
            Err(tungstenite::HandshakeError::Failure(Error::Http(response))) => {
                Err(response.status().as_u16())
            }
            Err(other) => panic!("{other}"),
        }
    }

    /// A tab of a pupil who has not joined yet.
    pub(crate) fn tab(&self) -> Tab {
        Tab::new(self.socket(&format!("/class?token={}", self.code), &[]).expect("accepted"))
    }

    /// A pupil, with the name and the key that the class gave.
    pub(crate) fn join(&self, name: &str) -> Pupil {
        self.join_with(name, None)
    }

    pub(crate) fn join_with(&self, name: &str, key: Option<&str>) -> Pupil {
        let mut tab = self.tab();
        tab.say(&json!({ "join": { "name": name, "key": key } }));
        let welcome = tab.hear("welcome");
        Pupil::new(tab, &welcome)
    }

    /// A pupil, if the class has a place.
    pub(crate) fn try_join(&self, name: &str) -> Option<Pupil> {
        let tab = Tab::new(self.socket(&format!("/class?token={}", self.code), &[]).ok()?);
        tab.say(&json!({ "join": { "name": name, "key": null } }));
        let answer = wait_for("an answer", || tab.heard.try_recv().map_err(|error| error.to_string()));
        answer.get("welcome").map(|welcome| Pupil::new(tab, welcome))
    }

    pub(crate) fn teacher(&self) -> Tab {
        Tab::new(self.socket(&format!("/teacher?token={}", self.secret), &[]).expect("accepted"))
    }

    /// Opens a pupil's session with the real arm. The error is the HTTP status.
    pub(crate) fn frames(&self, key: &str) -> Result<WebSocket<TcpStream>, u16> {
        self.socket(&format!("/frames?token={key}"), &[])
    }
}

/// A pupil's tab in the class.
pub(crate) struct Pupil {
    pub(crate) name: String,
    pub(crate) key: String,
    pub(crate) tab: Tab,
}

impl Pupil {
    fn new(tab: Tab, welcome: &Value) -> Self {
        let text = |name: &str| welcome[name].as_str().expect("a text").to_owned();
        Self { name: text("name"), key: text("key"), tab }
    }
}

/// A tab. A thread answers the questions of the class as soon as they come.
pub(crate) struct Tab {
    to_say: Sender<String>,
    heard: Receiver<Value>,
}

impl Tab {
    fn new(mut socket: WebSocket<TcpStream>) -> Self {
        socket.get_ref().set_read_timeout(Some(PIECE)).expect("a timeout");
        let ((to_say, orders), (news, heard)) = (channel(), channel());
        thread::spawn(move || drop(run(&mut socket, &orders, &news)));
        Self { to_say, heard }
    }

    pub(crate) fn say(&self, message: &Value) {
        self.say_text(&message.to_string());
    }

    pub(crate) fn say_text(&self, text: &str) {
        // The connection may have ended. The test notices this when it receives.
        let _ = self.to_say.send(text.to_owned());
    }

    /// The content of the next message of this kind. Others are skipped.
    #[track_caller]
    pub(crate) fn hear(&mut self, kind: &str) -> Value {
        self.hear_where(kind, |_| true)
    }

    /// The content of the next message of this kind that meets a condition.
    #[track_caller]
    pub(crate) fn hear_where(&mut self, kind: &str, holds: impl Fn(&Value) -> bool) -> Value {
        let mut last = Value::Null;
        wait_for(&format!("a message: {kind}"), || {
            while let Ok(mut message) = self.heard.try_recv() {
                if message.get(kind).is_some_and(&holds) {
                    return Ok(message[kind].take());
                }
                last = message;
            }
            Err(format!("the last one is {last}"))
        })
    }

    /// The messages that have arrived and were not read yet.
    pub(crate) fn heard_so_far(&self) -> Vec<Value> {
        self.heard.try_iter().collect()
    }

    /// Waits until the server has closed the connection.
    #[track_caller]
    pub(crate) fn wait_for_end(&self) {
        wait_for("the connection ends", || match self.heard.try_recv() {
            Err(TryRecvError::Disconnected) => Ok(()),
            other => Err(format!("{other:?}")),
        });
    }
}

/// Exchanges messages until the connection ends, or the tab is dropped.
fn run(
    socket: &mut WebSocket<TcpStream>,
    orders: &Receiver<String>,
    news: &Sender<Value>,
) -> Result<(), Error> {
    let report = json!({ "report": {
        "points": [[0, 0, 80], [0, 20, 200], [0, 40, 210], [0, 230, 120], [0, 230, 40]],
        "doing": "moving", "goals": { "reached": 1, "all": 5 }, "is_hidden": false } });
    loop {
        match orders.try_recv() {
            Ok(text) => socket.send(Message::text(text))?,
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => return socket.close(None),
        }
        let message = match socket.read() {
            Err(Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => continue,
            message => message?,
        };
        let Message::Text(text) = message else { continue };
        let message: Value = serde_json::from_str(&text).expect("JSON");
        if message.get("ask").is_some() {
            socket.send(Message::text(report.to_string()))?;
        }
        let _ = news.send(message);
    }
}
