//! A simulator, and a server that shares it.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use serde_json::Value;
use system_tests::process::{self, RunningProgram};
use system_tests::programs::{host_sim, tool};
use system_tests::registers::DEVICE_CODE;
use system_tests::relay::{Relay, Watch};
use system_tests::wait::{wait_for, wait_until};
use system_tests::{ArmClient, read_request};
use tempfile::TempDir;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// The `Origin` header of a web page that a program of this computer serves.
pub(crate) const LOCAL_PAGE: (&str, &str) = ("origin", "http://localhost:3000");

/// A simulator and a server, in a folder with their links.
pub(crate) struct Served {
    pub(crate) server: RunningProgram,
    pub(crate) simulator: RunningProgram,
    pub(crate) ports: Vec<PathBuf>,
    /// Between the server and the simulator if a test watches the frames.
    relay: Option<Relay>,
    pub(crate) folder: TempDir,
}

/// The link of the simulator when a relay is between it and the server.
const SIMULATOR: &str = "sim";

impl Served {
    /// Starts a server with the pseudo-terminals `a`, `b`, ..., a TCP port and a WebSocket.
    pub(crate) fn start(ptys: usize, options: &[&str]) -> Self {
        Self::start_with(tool(), ptys, options, None)
    }

    /// Starts a server that may have at most this many file descriptors.
    pub(crate) fn start_with_descriptors(most: usize, ptys: usize) -> Self {
        let tool = tool();
        let mut command = Command::new("sh");
        command.args(["-c", &format!("ulimit -n {most}; exec \"$0\" \"$@\"")]).arg(tool.get_program());
        command.envs(tool.get_envs().filter_map(|(name, value)| Some((name, value?))));
        Self::start_with(command, ptys, &[], None)
    }

    /// Starts a server. `watch` sees each frame between the server and the arm.
    pub(crate) fn start_watched(ptys: usize, options: &[&str], watch: Watch) -> Self {
        Self::start_with(tool(), ptys, options, Some(watch))
    }

    fn start_with(mut command: Command, ptys: usize, options: &[&str], watch: Option<Watch>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let simulator = simulator_at(&folder.path().join(if watch.is_some() { SIMULATOR } else { "arm" }));
        let relay = watch.map(|watch| plug(folder.path(), watch));
        command
            .current_dir(&folder)
            .env("XDG_RUNTIME_DIR", folder.path())
            .args(["--port", "./arm", "serve", "--tcp", "0", "--ws", "0"])
            .args(options);
        for name in names(ptys) {
            command.args(["--pty", &name]);
        }
        let (server, ports) = process::start(&mut command, ptys + 3).expect("the server is ready");
        let served = Self { server, simulator, ports, relay, folder };
        if ptys > 0 {
            // Not over a pseudo-terminal: the next program that opens it would receive a late reply.
            wait_for("the arm answers", || served.ask_for_arm(Duration::from_millis(500)));
        }
        served
    }

    /// Unplugs the arm from the server.
    pub(crate) fn unplug(&mut self) {
        self.relay = None;
        std::fs::remove_file(self.folder.path().join("arm")).expect("a link");
    }

    /// Plugs the arm in again, with a relay that shows each frame to `watch`.
    pub(crate) fn plug(&mut self, watch: Watch) {
        self.relay = Some(plug(self.folder.path(), watch));
    }

    pub(crate) fn open(&self, name: &str) -> ArmClient {
        ArmClient::open(&self.folder.path().join(name), 115_200)
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let port = self.ports.iter().rev().nth(2).and_then(|port| port.to_str()).expect("a TCP port");
        let (_, address) = port.split_once("://").expect("an address");
        let stream = TcpStream::connect(address).expect("a connection");
        stream.set_read_timeout(Some(Duration::from_secs(30))).expect("a timeout");
        stream
    }

    /// The path of the Unix socket.
    pub(crate) fn local_socket(&self) -> PathBuf {
        let ready = self.ports.last().and_then(|port| port.to_str()).expect("a socket");
        ready.strip_prefix("unix:").expect("a path").into()
    }

    /// Checks that the arm answers a new connection to the Unix socket within `answered`.
    pub(crate) fn ask_for_arm(&self, answered: Duration) -> Result<(), String> {
        let failed = |step: &'static str| move |error: io::Error| format!("{step}: {error}");
        let mut stream = UnixStream::connect(self.local_socket()).map_err(failed("connect"))?;
        stream.set_read_timeout(Some(answered)).expect("a timeout");
        stream.write_all(&read_request(DEVICE_CODE, 1)).map_err(failed("send"))?;
        stream.read_exact(&mut [0; 8]).map_err(failed("receive"))
    }

    fn web_url(&self) -> &str {
        self.ports.iter().rev().nth(1).and_then(|port| port.to_str()).expect("a WebSocket")
    }

    /// A connection to the WebSocket, before the handshake.
    pub(crate) fn connect_web(&self) -> TcpStream {
        let address =
            self.web_url().trim_start_matches("wss://").trim_start_matches("ws://").trim_end_matches("/ws");
        let stream = TcpStream::connect(address).expect("a connection");
        stream.set_nodelay(true).expect("an option");
        stream.set_read_timeout(Some(Duration::from_secs(30))).expect("a timeout");
        stream
    }

    pub(crate) fn wait_for_arm(&self, client: &mut ArmClient) {
        wait_until("the arm answers", || {
            client.send(&read_request(DEVICE_CODE, 1));
            client.reply_within(Duration::from_millis(500)).is_some()
        });
        client.drain();
    }
}

/// The names of `count` links to pseudo-terminals, 52 at most.
pub(crate) fn names(count: usize) -> impl Iterator<Item = String> {
    ('a'..='z').chain('A'..='Z').take(count).map(String::from)
}

/// Starts a relay to the simulator, and links `arm`, the port that the server opens, to the relay.
fn plug(folder: &Path, watch: Watch) -> Relay {
    let relay = Relay::open_watched(&folder.join(SIMULATOR), watch);
    std::os::unix::fs::symlink(relay.path(), folder.join("arm")).expect("a link");
    relay
}

pub(crate) fn simulator(folder: &Path) -> RunningProgram {
    simulator_at(&folder.join("arm"))
}

fn simulator_at(link: &Path) -> RunningProgram {
    let mut command = Command::new(host_sim());
    command.args(["--quiet", "--eeprom", "none", "--link"]).arg(link);
    process::start(&mut command, 1).expect("the simulator is ready").0
}

/// Sends a request and checks the reply.
#[track_caller]
pub(crate) fn exchange(stream: &mut TcpStream, request: &[u8], expected: &[u8]) {
    stream.write_all(request).expect("the server takes bytes");
    let mut received = vec![0; expected.len()];
    stream.read_exact(&mut received).expect("a reply");
    assert_eq!(received, expected);
}

/// Reads up to and including these bytes.
#[track_caller]
pub(crate) fn read_until(stream: &mut TcpStream, end: &[u8]) -> Vec<u8> {
    let mut received = Vec::new();
    while !received.ends_with(end) {
        let mut byte = [0];
        stream.read_exact(&mut byte).expect("an answer");
        received.push(byte[0]);
    }
    received
}

/// The HTTP request that opens the maker's WebSocket.
pub(crate) fn web_handshake(token: &str) -> String {
    format!(
        "GET /ws?token={token} HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )
}

/// A frame of a WebSocket client: `start` holds the bit for the last fragment and the kind.
pub(crate) fn web_frame(start: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len()).expect("a short frame");
    let mut frame = vec![start];
    match u8::try_from(length) {
        Ok(short @ ..126) => frame.push(0x80 | short),
        _ => frame.extend([[0x80 | 126].as_slice(), &length.to_be_bytes()].concat()),
    }
    // A mask of 0 leaves the payload as it is.
    frame.extend([0; 4]);
    frame.extend(payload);
    frame
}

/// A client of the maker's WebSocket.
pub(crate) struct WebClient(WebSocket<TcpStream>);

impl WebClient {
    /// Connects with these headers. The error is the HTTP status.
    pub(crate) fn connect(served: &Served, headers: &[(&'static str, &str)]) -> Result<Self, u16> {
        let stream = served.connect_web();
        let mut request = served.web_url().into_client_request().expect("a request");
        for (name, value) in headers {
            request.headers_mut().insert(*name, HeaderValue::from_str(value).expect("a header"));
        }
        match tungstenite::client(request, stream) {
            Ok((socket, _)) => Ok(Self(socket)),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
                Err(response.status().as_u16())
            }
            Err(other) => panic!("{other}"),
        }
    }

    pub(crate) fn send(&mut self, text: &str) {
        self.0.send(Message::text(text)).expect("the server takes messages");
    }

    /// Sends bytes as they are, which need not be whole messages.
    pub(crate) fn send_bytes(&mut self, bytes: &[u8]) {
        self.0.get_mut().write_all(bytes).expect("the server takes bytes");
    }

    /// A second handle of the connection.
    pub(crate) fn stream(&self) -> TcpStream {
        self.0.get_ref().try_clone().expect("a second handle")
    }

    /// The next message; `None` if none comes in 30 s, the connection has ended, or the message is not JSON, such as a pong.
    pub(crate) fn receive(&mut self) -> Option<Value> {
        let message = self.0.read().ok()?;
        message.to_text().ok().and_then(|text| serde_json::from_str(text).ok())
    }

    #[track_caller]
    pub(crate) fn read(&mut self, address: u8, count: u8) -> Vec<u8> {
        self.send(&format!(r#"{{"cmd":"read","id":{address},"num":{count}}}"#));
        let answer = self.receive().expect("an answer");
        assert_eq!(answer["status"], "ok", "{answer}");
        let values = answer["data"].as_array().expect("values").iter();
        values.map(|value| u8::try_from(value.as_u64().expect("a number")).expect("a byte")).collect()
    }
}
