//! A connection of a browser: one HTTP request, then a file, or a WebSocket with frames.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;

use protocol_core::time::{Duration, Instant};
use rustix::event::{PollFd, PollFlags};
use rustix::net::sockopt::set_socket_send_buffer_size;
use tungstenite::handshake::machine::TryParse;
use tungstenite::handshake::server::Request;

use super::answer::{Answer, Site, bad_request};
use super::frame_socket::FrameSocket;
use crate::hub::Hub;
use crate::server::listener::SEND_BUFFER;

/// The longest request.
const LONGEST_REQUEST: usize = 16 * 1_024;
/// How long a request and its answer may take.
const TIMEOUT: Duration = Duration::from_millis(30_000);
/// Bytes of a file that the kernel keeps; the kernel doubles it.
const FILE_BUFFER: usize = 256 * 1_024;

/// A connection of a browser.
#[derive(Debug)]
pub(crate) struct PageConnection {
    stream: TcpStream,
    state: PageState,
    deadline: Instant,
}

#[derive(Debug)]
enum PageState {
    /// The bytes of the request so far.
    Request(Vec<u8>),
    /// The answer is sent from this byte on.
    Answer(Vec<u8>, usize),
    /// The same, and frames follow it.
    Upgrade(Vec<u8>, usize),
    Frames(Box<FrameSocket>),
    Closed(Option<Box<FrameSocket>>),
}

impl PageConnection {
    pub(crate) fn new(stream: TcpStream, now: Instant) -> Self {
        // A smaller buffer is only slower.
        let _ = set_socket_send_buffer_size(&stream, FILE_BUFFER);
        Self { stream, state: PageState::Request(Vec::new()), deadline: now + TIMEOUT }
    }

    /// Reads the request, or messages with frames.
    pub(crate) fn receive(&mut self, site: Site<'_>, hub: &mut Hub, now: Instant) {
        match &mut self.state {
            PageState::Request(request) => match read_request(&self.stream, request, site) {
                Ok(None) => {}
                Ok(Some(next)) => self.state = next,
                Err(_) => self.state = PageState::Closed(None),
            },
            PageState::Frames(socket) => {
                if socket.receive(hub, now).is_err() {
                    self.close();
                }
            }
            PageState::Answer(..) | PageState::Upgrade(..) | PageState::Closed(_) => {}
        }
    }

    /// Sends the answer, or replies and reports.
    pub(crate) fn send(&mut self, hub: &mut Hub, baud: u32) {
        let outcome = match &mut self.state {
            PageState::Answer(bytes, sent) | PageState::Upgrade(bytes, sent) => {
                write_rest(&self.stream, bytes, sent)
            }
            PageState::Frames(socket) => socket.send(hub).map(|()| false),
            PageState::Request(_) | PageState::Closed(_) => Ok(false),
        };
        match outcome {
            Ok(true) => self.finish_answer(hub, baud),
            Ok(false) => {}
            Err(_) => self.close(),
        }
    }

    fn finish_answer(&mut self, hub: &mut Hub, baud: u32) {
        let is_upgrade = matches!(self.state, PageState::Upgrade(..));
        self.state = PageState::Closed(None);
        if let (true, Ok(stream)) = (is_upgrade, self.stream.try_clone()) {
            let _ = set_socket_send_buffer_size(&stream, SEND_BUFFER);
            self.state = PageState::Frames(Box::new(FrameSocket::new(stream, hub, baud)));
        }
    }

    fn close(&mut self) {
        let state = std::mem::replace(&mut self.state, PageState::Closed(None));
        if let PageState::Frames(socket) = state {
            self.state = PageState::Closed(Some(socket));
        }
    }

    pub(crate) fn is_closed(&self, now: Instant) -> bool {
        match &self.state {
            PageState::Frames(_) => false,
            PageState::Closed(_) => true,
            PageState::Request(_) | PageState::Answer(..) | PageState::Upgrade(..) => self.deadline <= now,
        }
    }

    pub(crate) fn disconnect(self, hub: &mut Hub, now: Instant) {
        if let PageState::Frames(socket) | PageState::Closed(Some(socket)) = self.state {
            socket.disconnect(hub, now);
        }
    }

    pub(crate) fn interest(&self) -> PollFd<'_> {
        let interest = match &self.state {
            PageState::Request(_) => PollFlags::IN,
            PageState::Answer(..) | PageState::Upgrade(..) => PollFlags::OUT,
            PageState::Frames(socket) => socket.interest(),
            PageState::Closed(_) => PollFlags::empty(),
        };
        PollFd::new(&self.stream, interest)
    }

    /// When to call [`PageConnection::receive`] without other events.
    pub(crate) fn deadline(&self) -> Instant {
        match &self.state {
            PageState::Frames(socket) => socket.deadline(),
            _ => self.deadline,
        }
    }
}

/// Reads what is there. Returns the next state when the request is whole.
fn read_request(
    mut stream: &TcpStream,
    request: &mut Vec<u8>,
    site: Site<'_>,
) -> std::io::Result<Option<PageState>> {
    let mut bytes = [0; 4_096];
    let count = match stream.read(&mut bytes) {
        Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
        Ok(count) => count,
        Err(error) if is_blocked(&error) => return Ok(None),
        Err(error) => return Err(error),
    };
    request.extend_from_slice(bytes.get(..count).unwrap_or(&[]));
    Ok(match Request::try_parse(request) {
        Ok(Some((_, request))) => Some(match site.answer(&request) {
            Answer::Whole(bytes) => PageState::Answer(bytes, 0),
            Answer::Frames(bytes) => PageState::Upgrade(bytes, 0),
        }),
        Ok(None) if request.len() < LONGEST_REQUEST => None,
        Ok(None) | Err(_) => Some(PageState::Answer(bad_request(), 0)),
    })
}

/// Writes what the stream takes. Returns whether all is written.
fn write_rest(mut stream: &TcpStream, bytes: &[u8], sent: &mut usize) -> std::io::Result<bool> {
    while let Some(rest @ [_, ..]) = bytes.get(*sent..) {
        match stream.write(rest) {
            Ok(count) => *sent += count,
            Err(error) if is_blocked(&error) => return Ok(false),
            Err(error) => return Err(error),
        }
    }
    Ok(true)
}

fn is_blocked(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}
