//! Relays bytes between a port and the emulator's socket in both directions.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::Path;

use host_sim::signals::Signals;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use tty_ports::clients::Clients;
use tty_ports::pty::Pty;

use crate::process::TaskResult;

/// The largest number of bytes in one read. The port is not read while earlier bytes from it still wait for the emulator.
const CAPACITY: usize = 4_096;
/// The socket is not read while this many bytes wait for a host that reads late. A wire never makes the chip wait. QEMU does, if
/// its socket is full: the machine stands still, and its clock goes on. The firmware takes this time for a pause inside a frame,
/// and drops the frame (D4).
const WAITING_FOR_HOST: usize = 1 << 16;
/// The longest sleep while the firmware's log is printed, because the log has to be polled.
const POLL_PERIOD: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// A port and the socket behind it.
pub(crate) struct Relay {
    clients: Option<Clients>,
    port: Pty,
    socket: UnixStream,
    to_arm: Vec<u8>,
    to_host: Vec<u8>,
}

impl Relay {
    /// Opens a port for the emulator at the other end of `socket`.
    pub(crate) fn new(socket: UnixStream) -> io::Result<Self> {
        socket.set_nonblocking(true)?;
        let mut clients = Clients::new().inspect_err(Pty::warn_of).ok();
        let port = Pty::open(clients.as_mut())?;
        Ok(Self { clients, port, socket, to_arm: Vec::new(), to_host: Vec::new() })
    }

    pub(crate) fn port(&self) -> &Path {
        self.port.path()
    }

    /// Transfers the available bytes in both directions, and updates the clients of the port.
    pub(crate) fn transfer(&mut self) -> TaskResult {
        let mut bytes = [0; CAPACITY];
        if self.to_arm.is_empty() {
            let count = self.port.read(&mut bytes)?;
            self.to_arm.extend(bytes.iter().take(count));
        }
        // Update the clients after the read, so that the sender of these bytes is known before the reply arrives.
        if let Some(clients) = &mut self.clients {
            clients.update()?;
            if self.port.update_clients(clients)? {
                self.to_host.clear();
            }
        }
        let count = if_ready(self.socket.write(&self.to_arm))?.unwrap_or(0);
        self.to_arm.drain(..count);
        if self.to_host.len() < WAITING_FOR_HOST {
            match if_ready(self.socket.read(&mut bytes))? {
                Some(0) => Err("the emulator has ended")?,
                count => self.to_host.extend(bytes.iter().take(count.unwrap_or(0))),
            }
        }
        // Without a client, bytes are dropped, as on a wire.
        let count = if self.port.has_client() { self.port.write(&self.to_host)? } else { self.to_host.len() };
        self.to_host.drain(..count);
        Ok(())
    }

    /// Sleeps until bytes can be transferred, a client opens or closes the port, or a signal arrives. If `polls`, sleeps at most
    /// for [`POLL_PERIOD`].
    pub(crate) fn sleep(&self, signals: &Signals, polls: bool) -> io::Result<()> {
        let flags_if = |condition, flags| if condition { flags } else { PollFlags::empty() };
        let port = flags_if(self.to_arm.is_empty(), PollFlags::IN)
            | flags_if(!self.to_host.is_empty(), PollFlags::OUT);
        let socket = flags_if(self.to_host.len() < WAITING_FOR_HOST, PollFlags::IN)
            | flags_if(!self.to_arm.is_empty(), PollFlags::OUT);
        let signals = signals.as_fd();
        let clients = self.clients.as_ref().map_or(signals, AsFd::as_fd);
        let mut wanted = [
            PollFd::from_borrowed_fd(self.port.master(), port),
            PollFd::from_borrowed_fd(self.socket.as_fd(), socket),
            PollFd::from_borrowed_fd(signals, PollFlags::IN),
            PollFd::from_borrowed_fd(clients, PollFlags::IN),
        ];
        match poll(&mut wanted, polls.then_some(&POLL_PERIOD)) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

/// `None` if the operation would block or was interrupted.
fn if_ready(outcome: io::Result<usize>) -> io::Result<Option<usize>> {
    match outcome {
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(None),
        other => other.map(Some),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;

    use super::*;

    #[test]
    fn a_host_that_does_not_read_does_not_stop_the_emulator() -> TaskResult {
        let (socket, mut emulator) = UnixStream::pair()?;
        emulator.set_nonblocking(true)?;
        let mut relay = Relay::new(socket)?;
        let host = OpenOptions::new().read(true).write(true).open(relay.port())?;
        // The replies of the system test of D5.
        let replies = [7; 62_000];
        for reply in replies.chunks(62) {
            for byte in reply {
                emulator.write_all(&[*byte])?;
            }
            relay.transfer()?;
        }
        drop(host);
        Ok(())
    }
}
