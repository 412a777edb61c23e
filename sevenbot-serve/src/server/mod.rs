//! The server: the hub between the arm's serial port and the connections of its clients. Linux only.
//!
//! ```text
//!   ArmPort ◀──▶ Hub ◀─┬─▶ FrameConnection ◀──▶ pseudo-terminal, or TCP stream
//!                      └─▶ WebConnection   ◀──▶ WebSocket
//! ```
//!
//! One thread waits in poll(2) for all file descriptors and for the deadline of the hub. The arm's line carries at most
//! some thousand frames a second, which is little work for one thread. So there are no locks, and events are handled
//! in the order of this file.

mod arm_location;
mod arm_port;
mod connection;
mod handshake;
mod listener;
mod notice;
mod pty_connection;
mod start_error;
mod tcp_connection;
mod web_connection;

use std::io;
use std::net::SocketAddr;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::PathBuf;

use protocol_core::time::{Duration, Instant};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use tty_ports::clients::Clients;

use self::arm_port::ArmPort;
use self::listener::Listener;
use self::pty_connection::PtyConnection;
use self::tcp_connection::TcpConnection;
use self::web_connection::WebConnection;
use crate::hub::Hub;

pub use self::arm_location::ArmLocation;
pub use self::handshake::AccessPolicy;
pub use self::notice::Notice;
pub use self::start_error::StartError;

/// Clients over the network at the same time. The next one is closed at once.
pub const MOST_NETWORK_CLIENTS: usize = 32;

/// What to serve.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// The serial port of the arm.
    pub arm: ArmLocation,
    /// Its rate, in bits per second.
    pub baud: u32,
    /// Links to pseudo-terminals.
    pub ptys: Vec<PathBuf>,
    /// Address for clients that speak frames over TCP.
    pub tcp: Option<SocketAddr>,
    /// Address for clients of the maker's WebSocket.
    pub web_socket: Option<SocketAddr>,
    /// Who may connect over the network.
    pub access: AccessPolicy,
    /// Writes do not reach the arm.
    pub is_read_only: bool,
}

/// A running server.
#[derive(Debug)]
pub struct Server {
    hub: Hub,
    arm: ArmPort,
    ptys: Vec<PtyConnection>,
    pty_clients: Option<Clients>,
    tcp: Option<Listener>,
    streams: Vec<TcpConnection>,
    web_socket: Option<Listener>,
    web_clients: Vec<WebConnection>,
    config: ServerConfig,
    start: std::time::Instant,
}

impl Server {
    /// Opens everything but the arm's port.
    ///
    /// # Errors
    /// See [`StartError`].
    pub fn open(config: ServerConfig) -> Result<Self, StartError> {
        let mut hub = Hub::new(config.baud, config.is_read_only);
        let mut pty_clients = Clients::new().ok();
        let mut ptys = Vec::new();
        for link in &config.ptys {
            ptys.push(PtyConnection::open(&mut hub, pty_clients.as_mut(), link, config.baud)?);
        }
        let tcp = config.tcp.map(Listener::open).transpose()?;
        let web_socket = config.web_socket.map(Listener::open).transpose()?;
        let arm = ArmPort::new(config.arm.clone(), config.baud);
        let start = std::time::Instant::now();
        let (streams, web_clients) = (Vec::new(), Vec::new());
        Ok(Self { hub, arm, ptys, pty_clients, tcp, streams, web_socket, web_clients, config, start })
    }

    /// The address for TCP clients, with the port that the system chose for port 0.
    #[must_use]
    pub fn tcp_address(&self) -> Option<SocketAddr> {
        self.tcp.as_ref().map(Listener::address)
    }

    /// The address for WebSocket clients, likewise.
    #[must_use]
    pub fn web_socket_address(&self) -> Option<SocketAddr> {
        self.web_socket.as_ref().map(Listener::address)
    }

    /// Serves until `stop` is readable.
    ///
    /// # Errors
    /// The operating system fails: poll(2), inotify, or a pseudo-terminal.
    pub fn run(mut self, stop: &impl AsFd, notify: &mut dyn FnMut(Notice)) -> io::Result<()> {
        loop {
            let deadline = self.advance(notify)?;
            if self.wait(stop.as_fd(), deadline)? {
                return Ok(());
            }
        }
    }

    /// Passes all bytes that are there. Returns when to call again, without other events.
    fn advance(&mut self, notify: &mut dyn FnMut(Notice)) -> io::Result<Instant> {
        let now = self.now();
        self.arm.receive(&mut self.hub, now, notify);
        self.accept(now);
        if let Some(clients) = &mut self.pty_clients {
            clients.update()?;
        }
        for pty in &mut self.ptys {
            pty.receive(&mut self.hub, now, self.pty_clients.as_mut())?;
        }
        for stream in &mut self.streams {
            stream.receive(&mut self.hub, now);
        }
        for client in &mut self.web_clients {
            client.receive(&mut self.hub, now);
        }
        self.hub.poll(now);
        self.arm.send(&mut self.hub, now, notify);
        for pty in &mut self.ptys {
            pty.send(&mut self.hub)?;
        }
        for stream in &mut self.streams {
            stream.send(&mut self.hub);
        }
        for client in &mut self.web_clients {
            client.send(&mut self.hub, now);
        }
        for closed in self.streams.extract_if(.., |stream| stream.is_closed(now)) {
            closed.disconnect(&mut self.hub, now);
        }
        for closed in self.web_clients.extract_if(.., |client| client.is_closed(now)) {
            closed.disconnect(&mut self.hub, now);
        }
        Ok(self.deadline(now))
    }

    fn deadline(&self, now: Instant) -> Instant {
        let ptys = self.ptys.iter().map(PtyConnection::deadline);
        let streams = self.streams.iter().map(TcpConnection::deadline);
        let web_clients = self.web_clients.iter().map(WebConnection::deadline);
        let own = [self.hub.deadline(now), self.arm.deadline()];
        ptys.chain(streams).chain(web_clients).chain(own).min().unwrap_or(Instant::FAR_FUTURE)
    }

    /// Accepts clients. Those beyond the limit are closed at once.
    fn accept(&mut self, now: Instant) {
        while let Some(stream) = self.tcp.as_ref().and_then(Listener::accept) {
            if !self.is_full() {
                let (token, baud) = (self.config.access.token.clone(), self.config.baud);
                self.streams.push(TcpConnection::new(&mut self.hub, stream, token, baud, now));
            }
        }
        while let Some(stream) = self.web_socket.as_ref().and_then(Listener::accept) {
            if !self.is_full() {
                let access = self.config.access.clone();
                self.web_clients.extend(WebConnection::new(stream, access, &mut self.hub, now));
            }
        }
    }

    fn is_full(&self) -> bool {
        self.streams.len() + self.web_clients.len() >= MOST_NETWORK_CLIENTS
    }

    /// Sleeps until an event or the deadline. Returns whether `stop` is readable.
    fn wait(&self, stop: BorrowedFd<'_>, deadline: Instant) -> io::Result<bool> {
        let mut events = vec![PollFd::new(&stop, PollFlags::IN)];
        events.extend(self.arm.interest(&self.hub));
        events.extend(self.pty_clients.as_ref().map(|clients| PollFd::new(clients, PollFlags::IN)));
        events.extend(self.ptys.iter().map(PtyConnection::interest));
        events.extend(self.tcp.as_ref().map(|listener| PollFd::new(listener, PollFlags::IN)));
        events.extend(self.streams.iter().map(TcpConnection::interest));
        events.extend(self.web_socket.as_ref().map(|listener| PollFd::new(listener, PollFlags::IN)));
        events.extend(self.web_clients.iter().map(WebConnection::interest));
        match poll(&mut events, timeout(deadline - self.now()).as_ref()) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
        Ok(events.first().is_some_and(|event| !event.revents().is_empty()))
    }

    fn now(&self) -> Instant {
        Instant::from_micros(u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX))
    }
}

/// `None`: no timeout.
fn timeout(duration: Duration) -> Option<Timespec> {
    let micros = i64::try_from(duration.as_micros()).ok().filter(|&micros| micros < i64::MAX / 2_000)?;
    Some(Timespec { tv_sec: micros / 1_000_000, tv_nsec: micros % 1_000_000 * 1_000 })
}
