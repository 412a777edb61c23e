//! A WebSocket whose binary messages carry frames, as a client over TCP sends and gets them. A frame may be spread over
//! messages, and a message may hold several.

use std::io::{self, ErrorKind};
use std::net::TcpStream;

use protocol_core::time::Instant;
use rustix::event::PollFlags;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

use crate::hub::Hub;
use crate::server::connection::FrameConnection;

/// The longest message.
const LONGEST_MESSAGE: usize = 4_096;
/// Bytes for a page that does not read; then it is disconnected.
const MOST_OUTPUT: usize = 64 * 1_024;
/// Messages that are taken at once, so that a flood delays the others by a bounded time.
const MESSAGES_AT_ONCE: usize = 20;

/// A client of the hub behind a WebSocket.
#[derive(Debug)]
pub(crate) struct FrameSocket {
    socket: WebSocket<TcpStream>,
    connection: FrameConnection,
    is_blocked: bool,
    /// More messages may have been read from the stream, so poll(2) does not tell of them.
    has_more: bool,
}

impl FrameSocket {
    /// The handshake is complete.
    pub(crate) fn new(stream: TcpStream, hub: &mut Hub, baud: u32) -> Self {
        let config = WebSocketConfig::default()
            .max_message_size(Some(LONGEST_MESSAGE))
            .max_frame_size(Some(LONGEST_MESSAGE))
            .read_buffer_size(2 * LONGEST_MESSAGE)
            .write_buffer_size(0)
            .max_write_buffer_size(MOST_OUTPUT);
        let socket = WebSocket::from_raw_socket(stream, Role::Server, Some(config));
        Self { socket, connection: FrameConnection::new(hub, baud), is_blocked: false, has_more: false }
    }

    pub(crate) fn disconnect(self, hub: &mut Hub, now: Instant) {
        self.connection.disconnect(hub, now);
    }

    /// Passes the bytes of messages to the hub. An error means that the connection has ended.
    pub(crate) fn receive(&mut self, hub: &mut Hub, now: Instant) -> io::Result<()> {
        self.has_more = true;
        for _ in 0..MESSAGES_AT_ONCE {
            self.connection.push(hub, now);
            if !self.connection.has_room() {
                return Ok(());
            }
            match self.socket.read() {
                Ok(Message::Binary(bytes)) => self.connection.put(&bytes),
                Ok(_) => {}
                Err(error) => {
                    self.has_more = false;
                    return unless_blocked(error);
                }
            }
        }
        self.connection.push(hub, now);
        Ok(())
    }

    /// Sends replies and reports while the page takes them.
    pub(crate) fn send(&mut self, hub: &mut Hub) -> io::Result<()> {
        loop {
            self.is_blocked = match self.socket.flush() {
                Err(Error::Io(cause)) if cause.kind() == ErrorKind::WouldBlock => true,
                outcome => outcome.map_err(ended).map(|()| false)?,
            };
            let bytes = if self.is_blocked { Vec::new() } else { self.connection.take_output(hub) };
            if bytes.is_empty() {
                return Ok(());
            }
            self.socket.write(Message::binary(bytes)).or_else(unless_blocked)?;
        }
    }

    pub(crate) fn interest(&self) -> PollFlags {
        let mut interest = PollFlags::empty();
        interest.set(PollFlags::IN, self.connection.has_room());
        interest.set(PollFlags::OUT, self.is_blocked);
        interest
    }

    /// When to call [`FrameSocket::receive`] without other events.
    pub(crate) fn deadline(&self) -> Instant {
        if self.has_more && self.connection.has_room() { Instant::ZERO } else { self.connection.deadline() }
    }
}

fn unless_blocked(error: Error) -> io::Result<()> {
    match error {
        Error::Io(cause) if matches!(cause.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(()),
        other => Err(ended(other)),
    }
}

fn ended(error: Error) -> io::Error {
    io::Error::new(ErrorKind::ConnectionAborted, error)
}
