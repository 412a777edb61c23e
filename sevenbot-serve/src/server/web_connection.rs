//! A client of the maker's WebSocket over TCP.

use std::cell::Cell;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::rc::Rc;

use protocol_core::time::{Duration, Instant};
use rustix::event::{PollFd, PollFlags};
use tungstenite::handshake::server::ServerHandshake;
use tungstenite::handshake::{HandshakeError, MidHandshake};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket, accept_hdr_with_config};

use super::handshake::{AccessPolicy, Gate};
use crate::hub::Hub;
use crate::maker::MakerClient;

/// The longest message, as in the maker's firmware.
const LONGEST_MESSAGE: usize = 2_048;
/// Bytes for a client that does not read; then it is disconnected.
const MOST_OUTPUT: usize = 64 * 1_024;
/// How long a handshake may take.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_millis(5_000);
/// Messages that are taken at once, so that a flood delays the others by a bounded time.
const MESSAGES_AT_ONCE: usize = 20;

/// A client of the maker's WebSocket.
#[derive(Debug)]
pub(crate) struct WebConnection {
    /// Another handle of the same connection, for poll(2).
    stream: TcpStream,
    state: WebState,
    is_browser: Rc<Cell<bool>>,
    deadline: Instant,
    is_blocked: bool,
    /// More messages may have been read from the stream, so poll(2) does not tell of them.
    has_more: bool,
}

#[derive(Debug)]
enum WebState {
    Handshake(Box<MidHandshake<ServerHandshake<TcpStream, Gate>>>),
    Open(Box<WebSocket<TcpStream>>, MakerClient),
    Closed(Option<MakerClient>),
}

impl WebConnection {
    /// Begins the handshake. `None` if it failed.
    pub(crate) fn new(stream: TcpStream, access: AccessPolicy, hub: &mut Hub, now: Instant) -> Option<Self> {
        let is_browser = Rc::new(Cell::new(false));
        let gate = Gate { access, is_browser: Rc::clone(&is_browser) };
        let config = WebSocketConfig::default()
            .max_message_size(Some(LONGEST_MESSAGE))
            .max_frame_size(Some(LONGEST_MESSAGE))
            .read_buffer_size(2 * LONGEST_MESSAGE)
            .write_buffer_size(0)
            .max_write_buffer_size(MOST_OUTPUT);
        let handle = stream.try_clone().ok()?;
        let outcome = accept_hdr_with_config(stream, gate, Some(config));
        let state = next_state(outcome, hub, &is_browser);
        let deadline = now + HANDSHAKE_TIMEOUT;
        Some(Self { stream: handle, state, is_browser, deadline, is_blocked: false, has_more: false })
    }

    /// Goes on with the handshake, or takes messages.
    pub(crate) fn receive(&mut self, hub: &mut Hub, now: Instant) {
        let state = std::mem::replace(&mut self.state, WebState::Closed(None));
        self.state = match state {
            WebState::Handshake(handshake) => next_state(handshake.handshake(), hub, &self.is_browser),
            WebState::Open(mut socket, mut client) => {
                let outcome = take_messages(&mut socket, &mut client);
                client.advance(hub, now);
                self.has_more = matches!(outcome, Ok(true));
                match outcome {
                    Ok(_) => WebState::Open(socket, client),
                    Err(_) => WebState::Closed(Some(client)),
                }
            }
            closed @ WebState::Closed(_) => closed,
        };
    }

    /// Sends the answers that are there.
    pub(crate) fn send(&mut self, hub: &mut Hub, now: Instant) {
        let WebState::Open(socket, client) = &mut self.state else { return };
        match send_answers(socket, client, hub, now) {
            Ok(is_blocked) => self.is_blocked = is_blocked,
            Err(_) => self.close(),
        }
    }

    fn close(&mut self) {
        if let WebState::Open(_, client) = std::mem::replace(&mut self.state, WebState::Closed(None)) {
            self.state = WebState::Closed(Some(client));
        }
    }

    pub(crate) fn is_closed(&self, now: Instant) -> bool {
        match &self.state {
            WebState::Handshake(_) => self.deadline <= now,
            WebState::Open(..) => false,
            WebState::Closed(_) => true,
        }
    }

    pub(crate) fn disconnect(self, hub: &mut Hub, now: Instant) {
        if let WebState::Closed(Some(client)) | WebState::Open(_, client) = self.state {
            client.disconnect(hub, now);
        }
    }

    pub(crate) fn interest(&self) -> PollFd<'_> {
        let mut interest = PollFlags::empty();
        let has_room = !matches!(&self.state, WebState::Open(_, client) if !client.has_room());
        interest.set(PollFlags::IN, has_room);
        interest.set(PollFlags::OUT, self.is_blocked);
        PollFd::new(&self.stream, interest)
    }

    /// When to call [`WebConnection::receive`] without other events.
    pub(crate) fn deadline(&self) -> Instant {
        match &self.state {
            WebState::Handshake(_) => self.deadline,
            WebState::Open(_, client) if self.has_more && client.has_room() => Instant::ZERO,
            WebState::Open(..) | WebState::Closed(_) => Instant::FAR_FUTURE,
        }
    }
}

type Handshake = Result<WebSocket<TcpStream>, HandshakeError<ServerHandshake<TcpStream, Gate>>>;

fn next_state(outcome: Handshake, hub: &mut Hub, is_browser: &Cell<bool>) -> WebState {
    match outcome {
        Ok(socket) => WebState::Open(Box::new(socket), MakerClient::connect(hub, is_browser.get())),
        Err(HandshakeError::Interrupted(handshake)) => WebState::Handshake(Box::new(handshake)),
        Err(HandshakeError::Failure(_)) => WebState::Closed(None),
    }
}

/// Takes messages while there is room for them. Returns whether more may have been read from the stream. An error means
/// that the connection has ended.
fn take_messages(socket: &mut WebSocket<TcpStream>, client: &mut MakerClient) -> Result<bool, Error> {
    for _ in 0..MESSAGES_AT_ONCE {
        if !client.has_room() {
            return Ok(true);
        }
        match socket.read() {
            Ok(Message::Text(text)) => client.message(&text),
            Ok(_) => {}
            Err(error) => return unless_blocked(error).map(|()| false),
        }
    }
    Ok(true)
}

/// Carries out commands and sends answers one by one, while the client takes them. Returns whether it takes no more.
fn send_answers(
    socket: &mut WebSocket<TcpStream>,
    client: &mut MakerClient,
    hub: &mut Hub,
    now: Instant,
) -> Result<bool, Error> {
    loop {
        match socket.flush() {
            Ok(()) => {}
            Err(Error::Io(cause)) if cause.kind() == ErrorKind::WouldBlock => return Ok(true),
            Err(error) => return Err(error),
        }
        client.advance(hub, now);
        let Some(answer) = client.take_answer() else { return Ok(false) };
        socket.write(Message::text(answer)).or_else(unless_blocked)?;
    }
}

fn unless_blocked(error: Error) -> Result<(), Error> {
    match error {
        Error::Io(cause) if matches!(cause.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(()),
        other => Err(other),
    }
}
