//! Only the servos, on a pseudo-terminal: what a computer sees that has a servo bus behind a USB adapter.
//!
//! ```text
//!   client ◀──▶ Pty ──▶ Plant: the servos and their wire
//!                   ◀── Adapter ◀──┘
//! ```
//!
//! For a controller that runs elsewhere, and for whoever talks to servos directly. Raw bytes of the servo bus; the
//! servos hear a client only at their own baud rate. Signals switch the servos off and on and pull the adapter.

use std::io;
use std::os::fd::AsFd;
use std::path::PathBuf;

use protocol_core::time::Instant;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use tracing::{debug, info};

use crate::clients::Clients;
use crate::clock::{Clock, sleep_until};
use crate::link::{Link, LinkError};
use crate::pty::Pty;
use crate::signals::{Signals, Wish};
use arm_sim::adapter::{Adapter, Latency};
use arm_sim::plant::Plant;

/// Bytes taken from the client at a time.
const PIECE: usize = 4_096;

/// What the bus and its adapter are like.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Where a symbolic link to the port stands while the adapter is plugged in.
    pub link: Option<PathBuf>,
    /// The baud rate of the servos, in bits per second.
    pub baud: u32,
    /// How long the adapter keeps bytes.
    pub latency: Latency,
    /// What its delays are drawn from.
    pub seed: u64,
}

/// Why there is no port, or no more.
#[derive(Debug, thiserror::Error)]
pub enum ServosOnlyError {
    /// The link cannot be made.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The operating system failed.
    #[error("the operating system failed: {0}")]
    System(#[from] io::Error),
}

/// The servos, their wire and the adapter, which may be unplugged.
#[derive(Debug)]
pub struct ServosOnly {
    setup: Setup,
    plant: Plant,
    adapter: Adapter,
    port: Option<Port>,
    /// Bytes from the servos that were handed over, and that the port did not take yet.
    to_client: Vec<u8>,
    /// Shows each piece of bytes on the wire.
    trace: Option<fn(&str, &[u8])>,
}

/// The adapter's port while it is plugged in.
#[derive(Debug)]
struct Port {
    pty: Pty,
    clients: Option<Clients>,
    /// It stands as long as the port.
    _link: Option<Link>,
}

impl Port {
    fn open(link: Option<&PathBuf>) -> Result<Self, ServosOnlyError> {
        let mut clients = Clients::new().inspect_err(Pty::warn_of).ok();
        let pty = Pty::open(clients.as_mut())?;
        let link = link.map(|link| Link::new(link, pty.path())).transpose()?;
        Ok(Self { pty, clients, _link: link })
    }
}

impl ServosOnly {
    /// Plugs the adapter of these servos in.
    ///
    /// # Errors
    /// There is no pseudo-terminal, or no link to it.
    pub fn new(setup: Setup, mut plant: Plant) -> Result<Self, ServosOnlyError> {
        plant.ignore_collisions();
        let port = Some(Port::open(setup.link.as_ref())?);
        let adapter = Adapter::new(setup.latency, setup.seed);
        Ok(Self { setup, plant, adapter, port, to_client: Vec::new(), trace: None })
    }

    /// Shows all bytes on the wire with `trace`: the direction, and the bytes.
    pub fn watch(&mut self, trace: fn(&str, &[u8])) {
        self.trace = Some(trace);
    }

    /// The port's name; `None` while the adapter is unplugged.
    #[must_use]
    pub fn path(&self) -> Option<PathBuf> {
        self.port.as_ref().map(|port| port.pty.path().to_owned())
    }

    /// Serves clients until a signal says otherwise.
    ///
    /// # Errors
    /// The operating system fails.
    pub fn serve(mut self, clock: &mut Clock, signals: &mut Signals) -> Result<(), ServosOnlyError> {
        loop {
            let now = clock.now();
            for wish in signals.wishes() {
                match wish {
                    Wish::End => return Ok(()),
                    Wish::PowerCycle => self.power_cycle(now),
                    Wish::Unplug => self.unplug_or_plug_in()?,
                    Wish::RestartController => {}
                }
            }
            self.turn(now)?;
            self.sleep(clock, signals)?;
        }
    }

    fn power_cycle(&mut self, now: Instant) {
        info!("power cycle of the servos");
        self.plant.power_cycle(now);
    }

    /// Only the adapter: the servos keep their power.
    fn unplug_or_plug_in(&mut self) -> Result<(), ServosOnlyError> {
        self.to_client.clear();
        self.adapter = Adapter::new(self.setup.latency, self.setup.seed);
        if self.port.take().is_some() {
            info!("adapter unplugged");
            return Ok(());
        }
        let port = Port::open(self.setup.link.as_ref())?;
        info!("adapter plugged in, on {}", port.pty.path().display());
        self.port = Some(port);
        Ok(())
    }

    fn turn(&mut self, now: Instant) -> io::Result<()> {
        self.hear_client(now)?;
        let bytes = self.plant.poll(now);
        self.show("<-", &bytes);
        self.adapter.push(now, &bytes);
        let block = self.adapter.take(now);
        self.to_client.extend(block);
        self.tell_client()
    }

    /// Whatever the client has sent goes on the wire, unless its baud rate is not the servos'.
    fn hear_client(&mut self, now: Instant) -> io::Result<()> {
        let Some(Port { pty, clients, .. }) = &mut self.port else { return Ok(()) };
        let mut bytes = [0; PIECE];
        let count = pty.read(&mut bytes)?;
        let baud = pty.baud()?;
        if let Some(clients) = clients {
            clients.look()?;
            if pty.take_note_of(clients)? {
                self.to_client.clear();
            }
        }
        let bytes = bytes.get(..count).unwrap_or(&[]);
        if bytes.is_empty() {
            return Ok(());
        }
        if baud != self.setup.baud {
            debug!("{count} bytes at {baud} baud: no servo hears them, theirs is {}", self.setup.baud);
            return Ok(());
        }
        self.show("->", bytes);
        self.plant.bytes(now, bytes);
        Ok(())
    }

    /// A bus has no back-pressure: what the client does not take is lost.
    fn tell_client(&mut self) -> io::Result<()> {
        let bytes = std::mem::take(&mut self.to_client);
        let Some(Port { pty, .. }) = &self.port else { return Ok(()) };
        if pty.has_client() && !bytes.is_empty() && pty.write(&bytes)? < bytes.len() {
            debug!("the client does not read: an answer is lost");
        }
        Ok(())
    }

    fn show(&self, direction: &str, bytes: &[u8]) {
        if let Some(trace) = self.trace.filter(|_| !bytes.is_empty()) {
            trace(direction, bytes);
        }
    }

    /// Sleeps until the client sends, comes or goes, until the servos or the adapter have something due, or until a
    /// signal comes.
    fn sleep(&self, clock: &mut Clock, signals: &Signals) -> io::Result<()> {
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
