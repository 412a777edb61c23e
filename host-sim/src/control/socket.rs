//! The clients of a control socket: lines in, lines out, with bounded memory.
//!
//! A client that sends garbage gets errors. If a client does not read its answers, its next requests wait until it does. A line
//! that is too long ends the connection of its client, and a client beyond the limit is refused. Other clients are not
//! affected.

use std::io::{self, Read, Write};
use std::mem;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::Path;

use protocol_core::time::Instant;
use rustix::event::epoll::{self, EventData, EventFlags};
use serde_json::json;

use super::request::{ControlRefusal, line};
use crate::private_socket::{PrivateSocket, SocketError, is_temporary};

/// The longest line, in bytes.
const LONGEST_LINE: usize = 4_096;
/// No request of a client is executed while this many bytes of answers wait for the client.
const LONGEST_BACKLOG: usize = 64 * 1_024;
/// The most clients at the same time.
const CLIENTS: usize = 16;

/// When a request is answered, and with what.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ControlReply {
    /// At once, with this line.
    Line(String),
    /// At this virtual time, with a line that tells the time. The client's next requests wait.
    At(Instant),
}

/// A control socket and its clients.
#[derive(Debug)]
pub struct ControlSocket {
    socket: PrivateSocket,
    clients: Vec<ControlClient>,
}

#[derive(Debug)]
struct ControlClient {
    stream: UnixStream,
    input: Vec<u8>,
    output: Vec<u8>,
    /// The virtual time of the answer for which the client waits.
    waits_until: Option<Instant>,
    /// The client sends nothing more, or nothing more is accepted from it.
    is_at_end: bool,
    /// The connection failed.
    is_gone: bool,
    interest: EventFlags,
}

impl ControlSocket {
    /// Listens at `path`, for this user only.
    ///
    /// # Errors
    /// See [`SocketError`].
    pub fn listen(path: &Path) -> Result<Self, SocketError> {
        Ok(Self { socket: PrivateSocket::listen("control", path)?, clients: Vec::new() })
    }

    /// The path that was passed to [`ControlSocket::listen`].
    #[must_use]
    pub fn path(&self) -> &Path {
        self.socket.path()
    }

    /// Lets `epoll` report with `data` when [`ControlSocket::poll`] has to be called.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn register(&self, epoll: &OwnedFd, data: EventData) -> io::Result<()> {
        Ok(epoll::add(epoll, &self.socket, data, EventFlags::IN)?)
    }

    /// The earliest virtual time for which a client waits.
    #[must_use]
    pub fn due(&self) -> Option<Instant> {
        self.clients.iter().filter_map(|client| client.waits_until).min()
    }

    /// Accepts clients, executes the requests that have arrived, and sends answers, including those that are due at the virtual
    /// time `now`. Returns whether there was a request.
    ///
    /// # Errors
    /// The operating system fails: accept or epoll.
    pub fn poll(
        &mut self,
        epoll: &OwnedFd,
        data: EventData,
        now: Instant,
        mut execute: impl FnMut(&[u8]) -> ControlReply,
    ) -> io::Result<bool> {
        self.accept(epoll, data)?;
        let mut has_executed = false;
        for client in &mut self.clients {
            client.receive();
            client.answer_if_due(now);
            has_executed |= client.execute(&mut execute);
            client.send();
            client.update_interest(epoll, data)?;
        }
        // Closing a connection removes it from epoll.
        self.clients.retain(|client| !client.is_done());
        Ok(has_executed)
    }

    fn accept(&mut self, epoll: &OwnedFd, data: EventData) -> io::Result<()> {
        while let Some(stream) = self.socket.accept()? {
            let mut client = ControlClient::new(stream);
            if self.clients.len() >= CLIENTS {
                client.refuse(&ControlRefusal::new("16 clients are connected", "close one of them"));
                client.send();
                continue;
            }
            epoll::add(epoll, &client.stream, data, client.interest)?;
            self.clients.push(client);
        }
        Ok(())
    }
}

impl ControlClient {
    const fn new(stream: UnixStream) -> Self {
        let interest = EventFlags::IN;
        Self {
            stream,
            input: Vec::new(),
            output: Vec::new(),
            waits_until: None,
            is_at_end: false,
            is_gone: false,
            interest,
        }
    }

    fn receive(&mut self) {
        let room = LONGEST_LINE.saturating_sub(self.input.len());
        let mut bytes = [0; LONGEST_LINE];
        let Some(space) = bytes.get_mut(..room).filter(|space| !space.is_empty() && !self.is_at_end) else {
            return;
        };
        match self.stream.read(space) {
            Ok(0) => self.is_at_end = true,
            Ok(count) => self.input.extend(space.iter().take(count)),
            Err(error) => self.is_gone |= !is_temporary(&error),
        }
    }

    /// Executes the complete lines that have arrived. Returns whether there was a request.
    fn execute(&mut self, execute: &mut impl FnMut(&[u8]) -> ControlReply) -> bool {
        let mut has_executed = false;
        while self.output.len() < LONGEST_BACKLOG
            && self.waits_until.is_none()
            && let Some(end) = self.input.iter().position(|&byte| byte == b'\n')
        {
            let rest = self.input.split_off(end + 1);
            let request = mem::replace(&mut self.input, rest);
            if !request.trim_ascii().is_empty() {
                match execute(request.trim_ascii()) {
                    ControlReply::Line(line) => self.output.extend_from_slice(line.as_bytes()),
                    ControlReply::At(end) => self.waits_until = Some(end),
                }
                has_executed = true;
            }
        }
        if self.input.len() >= LONGEST_LINE && !self.input.contains(&b'\n') {
            self.input.clear();
            self.refuse(&ControlRefusal::new(
                "a line has more than 4096 bytes",
                "end each request with a line feed",
            ));
        }
        has_executed
    }

    /// Answers the request that waits for a virtual time.
    fn answer_if_due(&mut self, now: Instant) {
        if self.waits_until.take_if(|end| *end <= now).is_some() {
            let time = json!({ "time_us": now.as_micros() });
            self.output.extend_from_slice(line(Ok(time)).as_bytes());
        }
    }

    /// Sends an error, and then closes the connection.
    fn refuse(&mut self, refusal: &ControlRefusal) {
        self.output.extend_from_slice(line(Err(refusal.clone())).as_bytes());
        self.is_at_end = true;
    }

    fn send(&mut self) {
        while !self.output.is_empty() && !self.is_gone {
            match self.stream.write(&self.output) {
                Ok(count) => drop(self.output.drain(..count)),
                Err(error) if is_temporary(&error) => return,
                Err(_) => self.is_gone = true,
            }
        }
    }

    fn is_done(&self) -> bool {
        let has_request = self.input.contains(&b'\n');
        let has_work = has_request || self.waits_until.is_some() || !self.output.is_empty();
        self.is_gone || (self.is_at_end && !has_work)
    }

    fn update_interest(&mut self, epoll: &OwnedFd, data: EventData) -> io::Result<()> {
        let mut interest = EventFlags::empty();
        interest.set(EventFlags::IN, !self.is_at_end && self.input.len() < LONGEST_LINE);
        interest.set(EventFlags::OUT, !self.output.is_empty());
        if interest != self.interest && !self.is_done() {
            self.interest = interest;
            epoll::modify(epoll, &self.stream, data, interest)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader};

    use rustix::event::epoll::CreateFlags;

    use super::*;

    struct Rig {
        socket: ControlSocket,
        epoll: OwnedFd,
        directory: tempfile::TempDir,
    }

    impl Rig {
        fn new() -> Self {
            let directory = tempfile::tempdir().unwrap();
            let socket = ControlSocket::listen(&directory.path().join("control")).unwrap();
            let epoll = epoll::create(CreateFlags::CLOEXEC).unwrap();
            socket.register(&epoll, EventData::new_u64(0)).unwrap();
            Self { socket, epoll, directory }
        }

        fn connect(&self) -> UnixStream {
            let client = UnixStream::connect(self.directory.path().join("control")).unwrap();
            client.set_nonblocking(true).unwrap();
            client
        }

        /// Polls the socket. The answer to each request is its length.
        fn poll(&mut self) {
            self.poll_with(Instant::ZERO, |request| ControlReply::Line(format!("{}\n", request.len())));
        }

        fn poll_with(&mut self, now: Instant, answer: impl FnMut(&[u8]) -> ControlReply) {
            self.socket.poll(&self.epoll, EventData::new_u64(0), now, answer).unwrap();
        }

        fn lines(&mut self, client: &UnixStream) -> Vec<String> {
            self.poll();
            BufReader::new(client).lines().map_while(Result::ok).collect()
        }
    }

    #[test]
    fn each_line_has_an_answer_however_it_arrives() {
        let mut rig = Rig::new();
        let mut client = rig.connect();
        client.write_all(b"abc\n\n  \nab").unwrap();
        assert_eq!(rig.lines(&client), ["3"], "empty lines have no answer");
        client.write_all(b"cd\r\n").unwrap();
        assert_eq!(rig.lines(&client), ["4"]);
    }

    #[test]
    fn the_last_requests_are_answered_after_the_client_has_closed_its_direction() {
        let mut rig = Rig::new();
        let mut client = rig.connect();
        client.write_all(b"abc\nhalf a line").unwrap();
        client.shutdown(std::net::Shutdown::Write).unwrap();
        rig.poll();
        assert_eq!(rig.lines(&client), ["3"]);
        assert!(rig.socket.clients.is_empty());
    }

    #[test]
    fn a_line_without_end_ends_the_connection() {
        let mut rig = Rig::new();
        let (mut bad, mut good) = (rig.connect(), rig.connect());
        bad.write_all(&[b'x'; LONGEST_LINE + 1]).unwrap();
        good.write_all(b"abc\n").unwrap();
        assert_eq!(rig.lines(&good), ["3"]);
        assert!(rig.lines(&bad)[0].contains("4096"));
        assert_eq!(rig.socket.clients.len(), 1);
    }

    #[test]
    fn a_client_that_does_not_read_fills_no_memory() {
        let mut rig = Rig::new();
        let mut client = rig.connect();
        let mut sent = 0;
        for _ in 0..1_000 {
            sent += client.write(&[b"x\n".as_slice(); 2_000].concat()).unwrap_or(0);
            rig.poll_with(Instant::ZERO, |_| ControlReply::Line(format!("{}\n", "y".repeat(1_000))));
        }
        let [client] = rig.socket.clients.as_slice() else { panic!("one client") };
        assert!(client.output.len() < LONGEST_BACKLOG + 2_000 && client.input.len() <= LONGEST_LINE);
        assert!(sent < 1_000_000, "{sent} bytes were accepted");
    }

    #[test]
    fn a_client_that_waits_for_a_time_gets_its_answers_in_order() {
        let mut rig = Rig::new();
        let mut client = rig.connect();
        let end = Instant::from_micros(500);
        client.write_all(b"wait\nnext\n").unwrap();
        client.shutdown(std::net::Shutdown::Write).unwrap();
        for now in [0, 499] {
            rig.poll_with(Instant::from_micros(now), |_| ControlReply::At(end));
            assert_eq!(rig.socket.due(), Some(end));
        }
        rig.poll_with(end, |request| ControlReply::Line(format!("{}\n", request.len())));
        assert_eq!(rig.lines(&client), ["{\"ok\":{\"time_us\":500}}", "4"]);
        assert!(rig.socket.due().is_none() && rig.socket.clients.is_empty());
    }

    #[test]
    fn a_client_too_many_is_told_so() {
        let mut rig = Rig::new();
        let clients: Vec<UnixStream> = (0..=CLIENTS).map(|_| rig.connect()).collect();
        assert!(rig.lines(&clients[CLIENTS])[0].contains("16 clients"));
        drop(clients);
        rig.poll();
        assert!(rig.socket.clients.is_empty());
    }
}
