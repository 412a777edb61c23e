//! Bytes between a port and the emulator's socket, both ways. Knows nothing of frames.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::Path;

use host_sim::clients::Clients;
use host_sim::pty::Pty;
use host_sim::signals::Signals;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::run::Outcome;

/// How much may wait to get into the emulator: no more is read from the port meanwhile.
const CAPACITY: usize = 4_096;
/// How often there is something to do besides bytes, if there is.
const OFTEN: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// A port and the socket behind it.
pub(super) struct Relay {
    clients: Option<Clients>,
    port: Pty,
    socket: UnixStream,
    to_arm: Vec<u8>,
    to_host: Vec<u8>,
}

impl Relay {
    /// Opens a port for what is behind the socket.
    pub(super) fn new(socket: UnixStream) -> io::Result<Self> {
        socket.set_nonblocking(true)?;
        let mut clients = Clients::new().inspect_err(Pty::warn_of).ok();
        let port = Pty::open(clients.as_mut())?;
        Ok(Self { clients, port, socket, to_arm: Vec::new(), to_host: Vec::new() })
    }

    /// The name under which clients open the port.
    pub(super) fn port(&self) -> &Path {
        self.port.path()
    }

    /// Moves what can be moved.
    pub(super) fn turn(&mut self) -> Outcome {
        let mut bytes = [0; CAPACITY];
        if self.to_arm.is_empty() {
            let count = self.port.read(&mut bytes)?;
            self.to_arm.extend(bytes.iter().take(count));
        }
        // After the read, so that whoever sent these bytes is known by the time their answer goes out.
        if let Some(clients) = &mut self.clients {
            clients.update()?;
            if self.port.update_clients(clients)? {
                self.to_host.clear();
            }
        }
        let count = later(self.socket.write(&self.to_arm))?.unwrap_or(0);
        self.to_arm.drain(..count);
        if self.to_host.is_empty() {
            match later(self.socket.read(&mut bytes))? {
                Some(0) => Err("the emulator has ended")?,
                count => self.to_host.extend(bytes.iter().take(count.unwrap_or(0))),
            }
        }
        // With nobody there, bytes go nowhere, as on a wire.
        let count = if self.port.has_client() { self.port.write(&self.to_host)? } else { self.to_host.len() };
        self.to_host.drain(..count);
        Ok(())
    }

    /// Sleeps until there is something to move, a client, a signal, or, if `often`, for a moment.
    pub(super) fn sleep(&self, signals: &Signals, often: bool) -> io::Result<()> {
        let if_empty = |bytes: &[u8], flags| if bytes.is_empty() { flags } else { PollFlags::empty() };
        let if_waiting = |bytes: &[u8], flags| if bytes.is_empty() { PollFlags::empty() } else { flags };
        let port = if_empty(&self.to_arm, PollFlags::IN) | if_waiting(&self.to_host, PollFlags::OUT);
        let socket = if_empty(&self.to_host, PollFlags::IN) | if_waiting(&self.to_arm, PollFlags::OUT);
        let signals = signals.as_fd();
        let clients = self.clients.as_ref().map_or(signals, AsFd::as_fd);
        let mut wanted = [
            PollFd::from_borrowed_fd(self.port.master(), port),
            PollFd::from_borrowed_fd(self.socket.as_fd(), socket),
            PollFd::from_borrowed_fd(signals, PollFlags::IN),
            PollFd::from_borrowed_fd(clients, PollFlags::IN),
        ];
        match poll(&mut wanted, often.then_some(&OFTEN)) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

/// `None` where the answer is "not now".
fn later(outcome: io::Result<usize>) -> io::Result<Option<usize>> {
    match outcome {
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(None),
        other => other.map(Some),
    }
}
