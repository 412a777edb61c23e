//! A client that speaks frames over TCP, as pyserial's `socket://` does. With a token, its first line has to be the token.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;

use protocol_core::time::{Duration, Instant};
use rustix::event::PollFd;

use super::connection::{ByteStream, FrameConnection};
use crate::hub::Hub;
use crate::token::is_equal;

/// How long a client may take to send the token.
const TOKEN_TIMEOUT: Duration = Duration::from_millis(5_000);
/// The longest first line.
const LONGEST_LINE: usize = 256;

/// A client over TCP.
#[derive(Debug)]
pub(crate) struct TcpConnection {
    stream: TcpStream,
    connection: FrameConnection,
    login: Option<Login>,
    is_closed: bool,
}

/// The client has not sent the token yet.
#[derive(Debug)]
struct Login {
    token: String,
    line: Vec<u8>,
    deadline: Instant,
}

impl ByteStream for TcpStream {
    fn read(&self, bytes: &mut [u8]) -> io::Result<usize> {
        match Read::read(&mut &*self, bytes) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            other => none_if_blocked(other),
        }
    }

    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        none_if_blocked(Write::write(&mut &*self, bytes))
    }
}

fn none_if_blocked(outcome: io::Result<usize>) -> io::Result<usize> {
    match outcome {
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
        other => other,
    }
}

impl TcpConnection {
    pub(crate) fn new(
        hub: &mut Hub,
        stream: TcpStream,
        token: Option<String>,
        baud: u32,
        now: Instant,
    ) -> Self {
        let login = token.map(|token| Login { token, line: Vec::new(), deadline: now + TOKEN_TIMEOUT });
        Self { stream, connection: FrameConnection::new(hub, baud), login, is_closed: false }
    }

    pub(crate) fn disconnect(self, hub: &mut Hub, now: Instant) {
        self.connection.disconnect(hub, now);
    }

    /// Passes bytes to the hub, once the client has sent the token.
    pub(crate) fn receive(&mut self, hub: &mut Hub, now: Instant) {
        let outcome =
            if self.login.is_some() { self.log_in() } else { self.connection.read(&self.stream).map(drop) };
        self.is_closed |= outcome.is_err();
        if self.login.is_none() {
            self.connection.push(hub, now);
        }
    }

    fn log_in(&mut self) -> io::Result<()> {
        let Some(login) = &mut self.login else { return Ok(()) };
        let mut bytes = [0; LONGEST_LINE];
        let count = ByteStream::read(&self.stream, &mut bytes)?;
        login.line.extend_from_slice(bytes.get(..count).unwrap_or(&[]));
        let mut parts = login.line.splitn(2, |&byte| byte == b'\n');
        let (line, rest) = (parts.next().unwrap_or(&[]), parts.next());
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        match rest {
            Some(rest) if is_equal(line, login.token.as_bytes()) => {
                self.connection.put(rest);
                self.login = None;
                Ok(())
            }
            None if login.line.len() < LONGEST_LINE => Ok(()),
            _ => Err(ErrorKind::PermissionDenied.into()),
        }
    }

    pub(crate) fn send(&mut self, hub: &mut Hub) {
        self.is_closed |= self.connection.send(hub, Some(&self.stream)).is_err();
    }

    pub(crate) fn is_closed(&self, now: Instant) -> bool {
        self.is_closed || self.login.as_ref().is_some_and(|login| login.deadline <= now)
    }

    pub(crate) fn interest(&self) -> PollFd<'_> {
        PollFd::new(&self.stream, self.connection.interest())
    }

    pub(crate) fn deadline(&self) -> Instant {
        self.login.as_ref().map_or_else(|| self.connection.deadline(), |login| login.deadline)
    }
}
