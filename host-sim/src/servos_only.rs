//! Simulated servos behind a simulated USB adapter, on a pseudo-terminal.
//!
//! ```text
//!   client ◀──▶ Pty ──▶ Plant: the servos and their wire
//!                   ◀── UsbAdapter ◀──┘
//! ```
//!
//! The client is a controller in another process, or a tool for servos. The port carries the bytes of the servo bus. The
//! servos receive bytes only at their own baud rate. Signals switch the servos off and on, and unplug the adapter.

use std::io;
use std::os::fd::AsFd;
use std::path::PathBuf;

use protocol_core::time::Instant;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use tracing::{debug, info};

use crate::clock::{RealClock, sleep_until};
use crate::signals::{SignalAction, Signals};
use arm_sim::plant::Plant;
use arm_sim::usb_adapter::{Latency, UsbAdapter};
use tty_ports::clients::Clients;
use tty_ports::pty::Pty;
use tty_ports::symlink::{Symlink, SymlinkError};

/// Bytes per read from the client.
const PIECE: usize = 4_096;

/// The settings of the bus and its adapter.
#[derive(Clone, Debug)]
pub struct AdapterConfig {
    /// The path of a symbolic link to the port, which exists while the adapter is plugged in.
    pub link: Option<PathBuf>,
    /// The baud rate of the servos, in bits per second.
    pub baud: u32,
    /// The delay of each block of bytes from the adapter to the client, random within this range. A full block is sent at once.
    pub latency: Latency,
    /// The seed of the random delays of the adapter.
    pub seed: u64,
}

/// Why the servos cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServosOnlyError {
    /// The symbolic link cannot be created.
    #[error(transparent)]
    Symlink(#[from] SymlinkError),
    /// The operating system failed: the port, inotify or poll(2).
    #[error("the operating system failed: {0}")]
    System(#[from] io::Error),
}

/// The servos, their wire and the adapter, which may be unplugged.
#[derive(Debug)]
pub struct ServosOnly {
    config: AdapterConfig,
    plant: Plant,
    adapter: UsbAdapter,
    port: Option<AdapterPort>,
    /// Receives the direction and the bytes on the wire.
    trace: Option<fn(&str, &[u8])>,
}

/// The adapter's port while it is plugged in.
#[derive(Debug)]
struct AdapterPort {
    pty: Pty,
    clients: Option<Clients>,
    /// Dropped with the port, which removes the link.
    _symlink: Option<Symlink>,
}

impl AdapterPort {
    fn open(link: Option<&PathBuf>) -> Result<Self, ServosOnlyError> {
        let mut clients = Clients::new().inspect_err(Pty::warn_of).ok();
        let pty = Pty::open(clients.as_mut())?;
        let symlink = link.map(|link| Symlink::new(link, pty.path())).transpose()?;
        Ok(Self { pty, clients, _symlink: symlink })
    }
}

impl ServosOnly {
    /// Plugs in the adapter of these servos: creates the pseudo-terminal and the link.
    ///
    /// # Errors
    /// The pseudo-terminal or the link cannot be created.
    pub fn new(config: AdapterConfig, mut plant: Plant) -> Result<Self, ServosOnlyError> {
        plant.ignore_collisions();
        plant.set_baud(config.baud);
        let port = Some(AdapterPort::open(config.link.as_ref())?);
        let adapter = UsbAdapter::new(config.latency, config.seed);
        Ok(Self { config, plant, adapter, port, trace: None })
    }

    /// Passes direction and bytes on the wire to `trace` from now on.
    pub fn set_trace(&mut self, trace: fn(&str, &[u8])) {
        self.trace = Some(trace);
    }

    /// The path of the port; `None` while the adapter is unplugged.
    #[must_use]
    pub fn path(&self) -> Option<PathBuf> {
        self.port.as_ref().map(|port| port.pty.path().to_owned())
    }

    /// Serves clients until a signal ends it.
    ///
    /// # Errors
    /// The operating system fails, or the link cannot be created when the adapter is plugged in again.
    pub fn serve(mut self, clock: &mut RealClock, signals: &mut Signals) -> Result<(), ServosOnlyError> {
        loop {
            let now = clock.now();
            for action in signals.actions() {
                match action {
                    SignalAction::End => return Ok(()),
                    SignalAction::PowerCycle => self.power_cycle(now),
                    SignalAction::Unplug => self.unplug_or_plug_in()?,
                    SignalAction::RestartController => {}
                }
            }
            self.poll(now)?;
            self.sleep(clock, signals)?;
        }
    }

    fn power_cycle(&mut self, now: Instant) {
        info!("power cycle of the servos");
        self.plant.power_cycle(now);
    }

    /// Unplugs or plugs in the adapter. The servos keep their power.
    fn unplug_or_plug_in(&mut self) -> Result<(), ServosOnlyError> {
        self.adapter.clear();
        if self.port.take().is_some() {
            info!("adapter unplugged");
            return Ok(());
        }
        let port = AdapterPort::open(self.config.link.as_ref())?;
        info!("adapter plugged in, on {}", port.pty.path().display());
        self.port = Some(port);
        Ok(())
    }

    fn poll(&mut self, now: Instant) -> io::Result<()> {
        self.read_client(now)?;
        let bytes = self.plant.poll(now).to_vec();
        self.show("<-", &bytes);
        self.adapter.push(now, &bytes);
        let block = self.adapter.take(now);
        self.write_client(&block)
    }

    /// Puts the bytes of the client on the wire, if the client uses the servos' baud rate.
    fn read_client(&mut self, now: Instant) -> io::Result<()> {
        let Some(AdapterPort { pty, clients, .. }) = &mut self.port else { return Ok(()) };
        let mut bytes = [0; PIECE];
        let count = pty.read(&mut bytes)?;
        let baud = pty.baud()?;
        if let Some(clients) = clients {
            clients.update()?;
            if pty.update_clients(clients)? {
                self.adapter.clear();
            }
        }
        let bytes = bytes.get(..count).unwrap_or(&[]);
        if bytes.is_empty() {
            return Ok(());
        }
        if baud != self.config.baud {
            debug!("{count} bytes at {baud} baud: no servo hears them, theirs is {}", self.config.baud);
            return Ok(());
        }
        self.show("->", bytes);
        self.plant.bytes(now, bytes);
        Ok(())
    }

    /// Writes the bytes of the adapter to the client. A servo bus has no flow control: bytes that the client does not read are
    /// lost.
    fn write_client(&self, bytes: &[u8]) -> io::Result<()> {
        let Some(AdapterPort { pty, .. }) = &self.port else { return Ok(()) };
        if pty.has_client() && !bytes.is_empty() && pty.write(bytes)? < bytes.len() {
            debug!("the client does not read: an answer is lost");
        }
        Ok(())
    }

    fn show(&self, direction: &str, bytes: &[u8]) {
        if let Some(trace) = self.trace.filter(|_| !bytes.is_empty()) {
            trace(direction, bytes);
        }
    }

    /// Sleeps until the client sends, comes or goes, until a deadline of the servos or the adapter, or until a signal.
    fn sleep(&self, clock: &mut RealClock, signals: &Signals) -> io::Result<()> {
        let due = [self.plant.deadline(), self.adapter.deadline()].into_iter().flatten().min();
        let time = sleep_until(clock.now(), due.unwrap_or(Instant::FAR_FUTURE));
        let signals = signals.as_fd();
        let port = self.port.as_ref().map_or(signals, |port| port.pty.master());
        let clients = self.port.as_ref().and_then(|port| port.clients.as_ref());
        let clients = clients.map_or(signals, AsFd::as_fd);
        let mut wanted =
            [port, clients, signals].map(|source| PollFd::from_borrowed_fd(source, PollFlags::IN));
        match poll(&mut wanted, Some(&time)) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}
