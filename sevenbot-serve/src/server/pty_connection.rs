//! A pseudo-terminal that behaves like an arm of its own, for one program after the other.

use std::io;
use std::path::Path;

use protocol_core::time::Instant;
use rustix::event::PollFd;
use tty_ports::clients::Clients;
use tty_ports::pty::Pty;
use tty_ports::symlink::Symlink;

use super::connection::{ByteStream, FrameConnection};
use super::start_error::StartError;
use crate::hub::Hub;

/// A pseudo-terminal and its link.
#[derive(Debug)]
pub(crate) struct PtyConnection {
    pty: Pty,
    connection: FrameConnection,
    baud: u32,
    _link: Symlink,
}

impl ByteStream for Pty {
    fn read(&self, bytes: &mut [u8]) -> io::Result<usize> {
        Self::read(self, bytes)
    }

    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        Self::write(self, bytes)
    }
}

impl PtyConnection {
    pub(crate) fn open(
        hub: &mut Hub,
        clients: Option<&mut Clients>,
        link: &Path,
        baud: u32,
    ) -> Result<Self, StartError> {
        let pty = Pty::open(clients).map_err(StartError::Pty)?;
        let link = Symlink::new(link, pty.path())?;
        Ok(Self { pty, connection: FrameConnection::new(hub, baud), baud, _link: link })
    }

    /// Passes bytes to the hub. When the last program has closed the terminal, its streams of reports end, and the
    /// next program finds an arm that has just been opened.
    pub(crate) fn receive(
        &mut self,
        hub: &mut Hub,
        now: Instant,
        clients: Option<&mut Clients>,
    ) -> io::Result<()> {
        let count = self.connection.read(&self.pty)?;
        if let Some(clients) = clients {
            // After the read: the program that sent these bytes has to be counted before its reply is written.
            if count > 0 {
                clients.update()?;
            }
            if self.pty.update_clients(clients)? {
                self.connection.replace_client(hub, now, self.baud);
            }
        }
        self.connection.push(hub, now);
        Ok(())
    }

    pub(crate) fn send(&mut self, hub: &mut Hub) -> io::Result<()> {
        self.connection.send(hub, self.pty.has_client().then_some(&self.pty))
    }

    pub(crate) fn interest(&self) -> PollFd<'_> {
        PollFd::from_borrowed_fd(self.pty.master(), self.connection.interest())
    }

    pub(crate) fn deadline(&self) -> Instant {
        self.connection.deadline()
    }
}
