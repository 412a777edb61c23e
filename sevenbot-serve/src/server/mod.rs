//! The server: the hub between the arm's serial port and the connections of its clients. Linux only.
//!
//! ```text
//!   ArmPort ◀──▶ Hub ◀─┬─▶ FrameConnection ◀──▶ pseudo-terminal, or TCP stream
//!                      ├─▶ WebConnection   ◀──▶ WebSocket
//!                      └─▶ PageConnection  ◀──▶ HTTP: files of the page, and a WebSocket with frames
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
mod page;
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
use self::page::{PageConnection, Site};
use self::pty_connection::PtyConnection;
use self::tcp_connection::TcpConnection;
use self::web_connection::WebConnection;
use crate::hub::{Hub, HubOptions};

pub use self::arm_location::ArmLocation;
pub use self::handshake::AccessPolicy;
pub use self::notice::Notice;
pub use self::page::{PageConfig, PageFiles};
pub use self::start_error::StartError;

/// Clients over the network at the same time. The next one is closed at once.
pub const MOST_NETWORK_CLIENTS: usize = 32;

/// What to serve.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// The serial port of the arm; `None`: there is no arm.
    pub arm: Option<ArmLocation>,
    /// Its rate, in bits per second.
    pub baud: u32,
    /// Links to pseudo-terminals.
    pub ptys: Vec<PathBuf>,
    /// Address for clients that speak frames over TCP.
    pub tcp: Option<SocketAddr>,
    /// Address for clients of the maker's WebSocket.
    pub web_socket: Option<SocketAddr>,
    /// The page for a browser.
    pub page: Option<PageConfig>,
    /// Who may connect over TCP and the maker's WebSocket.
    pub access: AccessPolicy,
    /// Writes do not reach the arm.
    pub is_read_only: bool,
}

/// A running server.
#[derive(Debug)]
pub struct Server {
    hub: Hub,
    arm: Option<ArmPort>,
    ptys: Vec<PtyConnection>,
    pty_clients: Option<Clients>,
    tcp: Option<Listener>,
    streams: Vec<TcpConnection>,
    web_socket: Option<Listener>,
    web_clients: Vec<WebConnection>,
    page: Option<Listener>,
    page_clients: Vec<PageConnection>,
    config: ServerConfig,
    start: std::time::Instant,
}

impl Server {
    /// Opens everything but the arm's port.
    ///
    /// # Errors
    /// See [`StartError`].
    pub fn open(config: ServerConfig) -> Result<Self, StartError> {
        let mut hub =
            Hub::new(config.baud, HubOptions { is_read_only: config.is_read_only, ..HubOptions::default() });
        let mut pty_clients = Clients::new().ok();
        let mut ptys = Vec::new();
        for link in &config.ptys {
            ptys.push(PtyConnection::open(&mut hub, pty_clients.as_mut(), link, config.baud)?);
        }
        let tcp = config.tcp.map(Listener::open).transpose()?;
        let web_socket = config.web_socket.map(Listener::open).transpose()?;
        let page = config.page.as_ref().map(|page| Listener::open(page.address)).transpose()?;
        let arm = config.arm.clone().map(|location| ArmPort::new(location, config.baud));
        let start = std::time::Instant::now();
        let (streams, web_clients, page_clients) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self {
            hub,
            arm,
            ptys,
            pty_clients,
            tcp,
            streams,
            web_socket,
            web_clients,
            page,
            page_clients,
            config,
            start,
        })
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

    /// The address of the page, likewise.
    #[must_use]
    pub fn page_address(&self) -> Option<SocketAddr> {
        self.page.as_ref().map(Listener::address)
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
        if let Some(arm) = &mut self.arm {
            arm.receive(&mut self.hub, now, notify);
        }
        self.accept(now);
        self.receive(now)?;
        self.hub.poll(now);
        if let Some(arm) = &mut self.arm {
            arm.send(&mut self.hub, now, notify);
        }
        self.send(now)?;
        self.disconnect(now);
        Ok(self.deadline(now))
    }

    /// Takes the bytes of all clients.
    fn receive(&mut self, now: Instant) -> io::Result<()> {
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
        if let Some(PageConfig { token, files, .. }) = &self.config.page {
            let site = Site { files: *files, token, has_arm: self.arm.is_some() };
            for client in &mut self.page_clients {
                client.receive(site, &mut self.hub, now);
            }
        }
        Ok(())
    }

    /// Sends bytes to all clients.
    fn send(&mut self, now: Instant) -> io::Result<()> {
        for pty in &mut self.ptys {
            pty.send(&mut self.hub)?;
        }
        for stream in &mut self.streams {
            stream.send(&mut self.hub);
        }
        for client in &mut self.web_clients {
            client.send(&mut self.hub, now);
        }
        for client in &mut self.page_clients {
            client.send(&mut self.hub, self.config.baud);
        }
        Ok(())
    }

    /// Drops the clients that have left.
    fn disconnect(&mut self, now: Instant) {
        for closed in self.streams.extract_if(.., |stream| stream.is_closed(now)) {
            closed.disconnect(&mut self.hub, now);
        }
        for closed in self.web_clients.extract_if(.., |client| client.is_closed(now)) {
            closed.disconnect(&mut self.hub, now);
        }
        for closed in self.page_clients.extract_if(.., |client| client.is_closed(now)) {
            closed.disconnect(&mut self.hub, now);
        }
    }

    fn deadline(&self, now: Instant) -> Instant {
        let ptys = self.ptys.iter().map(PtyConnection::deadline);
        let streams = self.streams.iter().map(TcpConnection::deadline);
        let web_clients = self.web_clients.iter().map(WebConnection::deadline);
        let pages = self.page_clients.iter().map(PageConnection::deadline);
        let own = [Some(self.hub.deadline(now)), self.arm.as_ref().map(ArmPort::deadline)];
        let own = own.into_iter().flatten();
        ptys.chain(streams).chain(web_clients).chain(pages).chain(own).min().unwrap_or(Instant::FAR_FUTURE)
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
        while let Some(stream) = self.page.as_ref().and_then(Listener::accept) {
            if !self.is_full() {
                self.page_clients.push(PageConnection::new(stream, now));
            }
        }
    }

    fn is_full(&self) -> bool {
        self.streams.len() + self.web_clients.len() + self.page_clients.len() >= MOST_NETWORK_CLIENTS
    }

    /// Sleeps until an event or the deadline. Returns whether `stop` is readable.
    fn wait(&self, stop: BorrowedFd<'_>, deadline: Instant) -> io::Result<bool> {
        let mut events = vec![PollFd::new(&stop, PollFlags::IN)];
        events.extend(self.arm.as_ref().and_then(|arm| arm.interest(&self.hub)));
        events.extend(self.pty_clients.as_ref().map(|clients| PollFd::new(clients, PollFlags::IN)));
        events.extend(self.ptys.iter().map(PtyConnection::interest));
        events.extend(self.tcp.as_ref().map(|listener| PollFd::new(listener, PollFlags::IN)));
        events.extend(self.streams.iter().map(TcpConnection::interest));
        events.extend(self.web_socket.as_ref().map(|listener| PollFd::new(listener, PollFlags::IN)));
        events.extend(self.web_clients.iter().map(WebConnection::interest));
        events.extend(self.page.as_ref().map(|listener| PollFd::new(listener, PollFlags::IN)));
        events.extend(self.page_clients.iter().map(PageConnection::interest));
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
