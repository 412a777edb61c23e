//! `sevenbot view`: the page's files, and the arm behind `/frames`.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

use super::served::simulator;
use system_tests::process::{self, RunningProgram};
use system_tests::programs::tool;
use system_tests::read_request;
use system_tests::registers::{DEVICE_CODE, TARGET_POSITION};
use system_tests::wait::wait_until;
use tempfile::TempDir;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// A server of the page, with a simulator as its arm or without an arm.
struct Viewed {
    _server: RunningProgram,
    _simulator: Option<RunningProgram>,
    /// Such as `127.0.0.1:40000`.
    address: String,
    token: Option<String>,
    _folder: TempDir,
}

impl Viewed {
    /// Starts `sevenbot view` with the port of a simulator, or with `--simulate`. Needs a program that was built with the page.
    fn start(has_arm: bool) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let simulator = has_arm.then(|| simulator(folder.path()));
        let mut command = tool();
        command.current_dir(&folder);
        let arm: &[&str] = if has_arm { &["--port", "./arm"] } else { &["--simulate"] };
        command.args(["view", "--no-open", "--http", "0"]).args(arm);
        let (server, ports) = process::start(&mut command, 1)
            .unwrap_or_else(|line| panic!("{line}: build the page with `cargo xtask web`, then `sevenbot`"));
        let url = ports.first().and_then(|port| port.to_str()).expect("an address").to_owned();
        let (address, query) =
            url.strip_prefix("http://").and_then(|url| url.split_once('/')).expect("a URL");
        let token = query.strip_prefix("?token=").map(str::to_owned);
        Self { _server: server, _simulator: simulator, address: address.to_owned(), token, _folder: folder }
    }

    fn stream(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).expect("a connection");
        stream.set_read_timeout(Some(Duration::from_secs(30))).expect("a timeout");
        stream
    }

    /// The whole answer to a request with these headers.
    fn get(&self, path: &str, headers: &[(&str, &str)]) -> String {
        let mut stream = self.stream();
        let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
        write!(stream, "GET {path} HTTP/1.1\r\n{headers}\r\n").expect("a request");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("an answer");
        String::from_utf8_lossy(&answer).into_owned()
    }

    fn host(&self) -> (&'static str, &str) {
        ("Host", &self.address)
    }

    /// Connects to `/frames` with a token and headers. The error is the HTTP status.
    fn frames(&self, token: &str, headers: &[(&'static str, &str)]) -> Result<WebSocket<TcpStream>, u16> {
        let url = format!("ws://{}/frames?token={token}", self.address);
        let mut request = url.into_client_request().expect("a request");
        for (name, value) in headers {
            request.headers_mut().insert(*name, HeaderValue::from_str(value).expect("a header"));
        }
        match tungstenite::client(request, self.stream()) {
            Ok((socket, _)) => Ok(socket),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
                Err(response.status().as_u16())
            }
            Err(other) => panic!("{other}"),
        }
    }

    fn token(&self) -> &str {
        self.token.as_deref().expect("a token")
    }
}

/// Sends bytes in pieces, and waits for a reply of this length.
fn exchange(socket: &mut WebSocket<TcpStream>, request: &[u8], length: usize) -> Vec<u8> {
    for piece in request.chunks(3) {
        socket.send(Message::binary(piece.to_vec())).expect("the server takes messages");
    }
    let mut reply = Vec::new();
    while reply.len() < length {
        if let Message::Binary(bytes) = socket.read().expect("a message") {
            reply.extend_from_slice(&bytes);
        }
    }
    reply
}

#[test]
fn the_page_is_served_with_a_strict_policy() {
    let viewed = Viewed::start(true);
    let page = viewed.get(&format!("/?token={}", viewed.token()), &[viewed.host()]);
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n") && page.contains("<!doctype html>"), "{page}");
    assert!(page.contains("content-security-policy: default-src 'self'; "), "{page}");
    let module = viewed.get("/sevenbot_web_bg.wasm", &[viewed.host()]);
    assert!(module.contains("content-type: application/wasm\r\n"));
    assert!(!page.contains(viewed.token()), "the token is in the address only");
}

#[test]
fn other_paths_names_and_methods_are_refused() {
    let viewed = Viewed::start(true);
    for path in ["/../Cargo.toml", "/..%2fCargo.toml", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/none"] {
        assert!(viewed.get(path, &[viewed.host()]).starts_with("HTTP/1.1 404 "), "{path}");
    }
    assert!(viewed.get("/", &[("Host", "evil.example")]).starts_with("HTTP/1.1 403 "));
    assert!(viewed.get("/", &[]).starts_with("HTTP/1.1 403 "));
    let mut stream = viewed.stream();
    stream.write_all(b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n").expect("a request");
    let mut answer = [0; 12];
    stream.read_exact(&mut answer).expect("an answer");
    assert_eq!(&answer, b"HTTP/1.1 400");
}

#[test]
fn frames_need_the_token_and_the_page_of_this_server() {
    let viewed = Viewed::start(true);
    for token in ["", "0123456789abcdef0123456789abcdef"] {
        assert_eq!(viewed.frames(token, &[]).err(), Some(401), "{token}");
    }
    for origin in ["https://evil.example", "http://localhost:3000", "null"] {
        assert_eq!(viewed.frames(viewed.token(), &[("origin", origin)]).err(), Some(403), "{origin}");
    }
    assert_eq!(viewed.frames(viewed.token(), &[("host", "evil.example")]).err(), Some(403));
    let own = format!("http://{}", viewed.address);
    assert!(viewed.frames(viewed.token(), &[("origin", &own)]).is_ok());
}

#[test]
fn frames_reach_the_arm_and_its_replies_come_back() {
    let viewed = Viewed::start(true);
    wait_until("the arm answers", || {
        let Ok(mut socket) = viewed.frames(viewed.token(), &[]) else { return false };
        socket.get_ref().set_read_timeout(Some(Duration::from_millis(500))).expect("a timeout");
        let sent = socket.send(Message::binary(read_request(DEVICE_CODE, 1)));
        sent.is_ok() && socket.read().is_ok_and(|message| message.is_binary())
    });
    let mut socket = viewed.frames(viewed.token(), &[]).expect("accepted");
    let reply = exchange(&mut socket, &read_request(DEVICE_CODE, 1), 8);
    assert_eq!(reply.get(..6), Some(&[0xAA, 0x77, 0x03, DEVICE_CODE, 1, 7][..]), "{reply:02x?}");
    let reply = exchange(&mut socket, &read_request(TARGET_POSITION, 7), 14);
    assert_eq!(reply.get(..5), Some(&[0xAA, 0x77, 0x03, TARGET_POSITION, 7][..]), "{reply:02x?}");
}

#[test]
fn one_that_sends_nothing_holds_no_other() {
    let viewed = Viewed::start(true);
    let silent: Vec<_> = (0..10).map(|_| viewed.stream()).collect();
    for stream in &silent {
        (&mut &*stream).write_all(b"GET / HTTP/1.1\r\nHo").expect("half a request");
    }
    assert!(viewed.get("/", &[viewed.host()]).starts_with("HTTP/1.1 200 "));
    for stream in &silent {
        stream.shutdown(Shutdown::Both).expect("the end");
    }
}

#[test]
fn without_an_arm_the_page_opens_and_there_are_no_frames() {
    let viewed = Viewed::start(false);
    assert!(viewed.get("/", &[viewed.host()]).starts_with("HTTP/1.1 200 "));
    assert_eq!(viewed.token, None);
    assert_eq!(viewed.frames("", &[]).err(), Some(401));
}
