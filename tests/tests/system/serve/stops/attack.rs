//! Attacks on the server that could delay a stop or make the arm move after it.

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

use system_tests::registers::{MOTOR_STATE, TARGET_POSITION};
use system_tests::{read_request, write_request};

use super::gate::Gate;
use super::program::{Program, TOKEN, log_in};
use crate::serve::served::{Served, read_until, web_frame, web_handshake};

/// The host-link watchdog, in units of 10 ms.
const HOST_WATCHDOG: u8 = 186;
const NO_FRAMES: &[u8] = &[0xAA, 0x77, 0x06, 0xAA, 0x77, 0xAA, 0xFF, 0x00, 0x77, 0x03];

/// What the other programs do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Attack {
    /// No attack: only the program that streams targets, which also runs beside all other attacks.
    Stream,
    /// Targets, as fast as the server takes them.
    Targets,
    /// Reads of 255 registers without a pause.
    Readers,
    /// Writes of 255 registers.
    LongWrites,
    /// The motors are switched on again and again.
    MotorsOn,
    /// Targets through the maker's WebSocket, as fast as the server takes them.
    WebTargets,
    /// A message of the WebSocket without an end.
    Fragments,
    NoFrames,
    /// Programs that set a watchdog and are silent for longer than its time.
    Watchdogs,
    /// Connections that say nothing, speak HTTP, guess the token, or begin a frame.
    Connections,
}

impl Attack {
    pub(crate) const ALL: [Self; 10] = [
        Self::Stream,
        Self::Targets,
        Self::Readers,
        Self::LongWrites,
        Self::MotorsOn,
        Self::WebTargets,
        Self::Fragments,
        Self::NoFrames,
        Self::Watchdogs,
        // Last, because wrong tokens delay the next token from this address.
        Self::Connections,
    ];

    pub(crate) const fn attackers(self) -> usize {
        match self {
            Self::Stream => 0,
            Self::Readers => 31,
            Self::Fragments | Self::Connections => 4,
            _ => 12,
        }
    }

    /// Attacks in each turn of the gate, until the gate ends the programs.
    pub(crate) fn run(self, served: &Served, gate: &Gate) {
        while gate.wait() {
            match self {
                Self::Stream => {}
                Self::Readers => read_all(served, gate),
                Self::Targets => {
                    let frames = (40..140).flat_map(|value| write_request(TARGET_POSITION, &[value]));
                    flood(served, gate, &frames.collect::<Vec<u8>>());
                }
                Self::LongWrites => flood(served, gate, &write_request(0, &[0; 255])),
                Self::MotorsOn => flood(served, gate, &write_request(MOTOR_STATE, &[1])),
                Self::NoFrames => flood(served, gate, NO_FRAMES),
                Self::Watchdogs => silent(served, gate),
                Self::WebTargets => web_flood(served, gate),
                Self::Fragments => fragments(served, gate),
                Self::Connections => connections(served, gate),
            }
        }
    }
}

/// Connects a program, waits for its first reply, and tells the gate that the program has begun.
fn begin(served: &Served, gate: &Gate) -> TcpStream {
    let stream = log_in(served);
    Program(Box::new(stream.try_clone().expect("a second handle"))).read(TARGET_POSITION, 1);
    stream.set_write_timeout(Some(Duration::from_millis(20))).expect("a timeout");
    gate.has_begun();
    stream
}

/// Sends the bytes again and again, and resets the connection at the end of the turn.
fn flood(served: &Served, gate: &Gate, bytes: &[u8]) {
    send_without_end(&begin(served, gate), gate, bytes);
}

fn send_without_end(mut stream: &TcpStream, gate: &Gate, bytes: &[u8]) {
    let bytes = bytes.repeat(1 + 4_000 / bytes.len());
    let mut rest = bytes.as_slice();
    while gate.is_open() {
        match stream.write(rest) {
            Ok(count) => rest = &rest[count..],
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            // The server has ended the connection.
            Err(_) => return,
        }
        if rest.is_empty() {
            rest = &bytes;
        }
    }
    // Drop the bytes that wait in the connection, so that they are not carried out in the next turn.
    rustix::net::sockopt::set_socket_linger(stream, Some(Duration::ZERO)).expect("an option");
}

fn read_all(served: &Served, gate: &Gate) {
    let mut stream = begin(served, gate);
    let mut reply = [0; 262];
    while gate.is_open() {
        stream.write_all(&read_request(0, 255)).expect("taken");
        stream.read_exact(&mut reply).expect("a reply");
    }
}

fn silent(served: &Served, gate: &Gate) {
    let mut stream = begin(served, gate);
    while gate.is_open() {
        let _ = stream.write_all(&write_request(HOST_WATCHDOG, &[1]));
        std::thread::sleep(Duration::from_millis(25));
    }
    let _ = stream.write_all(&write_request(HOST_WATCHDOG, &[0]));
    let _ = stream.shutdown(Shutdown::Write);
}

/// A connection to the WebSocket, after the handshake.
fn upgraded(served: &Served) -> TcpStream {
    let mut stream = served.connect_web();
    stream.write_all(web_handshake(TOKEN).as_bytes()).expect("taken");
    let answer = read_until(&mut stream, b"\r\n\r\n");
    assert!(answer.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&answer));
    stream.set_write_timeout(Some(Duration::from_millis(20))).expect("a timeout");
    stream
}

fn web_flood(served: &Served, gate: &Gate) {
    let mut stream = upgraded(served);
    stream.write_all(&web_frame(0x81, br#"{"cmd":"read","id":46,"num":1}"#)).expect("taken");
    stream.read_exact(&mut [0; 2]).expect("an answer");
    gate.has_begun();
    let messages = (40..140)
        .flat_map(|value| web_frame(0x81, format!(r#"{{"cmd":"angle","id":0,"angle":{value}}}"#).as_bytes()));
    send_without_end(&stream, gate, &messages.collect::<Vec<u8>>());
}

fn fragments(served: &Served, gate: &Gate) {
    gate.has_begun();
    while gate.is_open() {
        let mut stream = upgraded(served);
        let _ = stream.write_all(&web_frame(0x01, b"{"));
        send_without_end(&stream, gate, &web_frame(0x00, b""));
    }
}

fn connections(served: &Served, gate: &Gate) {
    gate.has_begun();
    let mut silent = Vec::new();
    while gate.is_open() {
        for first in [&b""[..], b"POST / HTTP/1.1\r\n\r\n", b"battery-staple\n", b"\xAA"] {
            let mut stream = served.connect();
            let _ = stream.write_all(first);
            silent.push(stream);
        }
        if silent.len() > 40 {
            silent.clear();
        }
    }
}
