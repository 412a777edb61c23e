//! An arm on a pseudo-terminal: passes bytes between a [`SimulatedArm`] and a [`Pty`].

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;

use arm_sim::action::Action;
use arm_sim::controller::ArmController;
use arm_sim::faults::{ArmFault, FaultReport};
use arm_sim::pace;
use arm_sim::plant::Plant;
use arm_sim::servo_bus::ServoBus;
use arm_sim::simulated_arm::SimulatedArm;
use embedded_storage::nor_flash::{NorFlash, NorFlashError};
use motion_core::Controller;
use protocol_core::time::Instant;
use rustix::event::PollFlags;
use rustix::event::epoll::EventFlags;
use tracing::{Span, error, info};

use crate::snapshots::{SnapshotRefusal, Snapshots};
use tty_ports::clients::Clients;
use tty_ports::pty::Pty;

/// The most kept reports of faults that ended by themselves.
const ENDED_FAULTS: usize = 16;

/// An arm, its pseudo-terminal, and the kept copies of the arm.
#[derive(Debug)]
pub struct PtyArm<F, B = Plant, C = Controller> {
    simulation: SimulatedArm<F, B, C>,
    pty: Pty,
    /// The client does not read, and the kernel's buffers are full.
    is_blocked: bool,
    /// Bytes pass only from and to clients at the arm's baud rate.
    is_strict: bool,
    /// The span of its log lines.
    span: Span,
    /// The last faults that ended by themselves.
    ended_faults: Vec<FaultReport>,
    /// Copies of the arm, by name.
    snapshots: Snapshots<ArmSnapshot<F, B, C>>,
}

#[derive(Debug)]
struct ArmSnapshot<F, B, C> {
    simulation: SimulatedArm<F, B, C>,
    ended_faults: Vec<FaultReport>,
}

impl<F: NorFlash + Clone, B: ServoBus> PtyArm<F, B> {
    /// The value of a register as the controller holds it; 0 where the map has none.
    #[must_use]
    pub fn register(&self, address: u8) -> u8 {
        self.simulation.registers().get(address)
    }
}

impl<F: NorFlash + Clone, C: ArmController> PtyArm<F, Plant, C> {
    /// Adds a fault until it is removed.
    pub fn set_fault(&mut self, now: Instant, fault: ArmFault) {
        self.simulation.set_fault(now, fault, None);
    }

    /// Sets the seed of the random faults of the host line.
    pub fn set_seed(&mut self, seed: u64) {
        self.simulation.set_seed(seed);
    }

    /// Carries out an action and logs it. Returns the reports of the faults that it ended.
    pub fn act(&mut self, now: Instant, action: Action) -> Vec<FaultReport> {
        let _inside = self.span.enter();
        info!("{action}");
        self.simulation.act(now, action)
    }

    /// The arm without its port.
    pub const fn simulation_mut(&mut self) -> &mut SimulatedArm<F, Plant, C> {
        &mut self.simulation
    }

    /// Is a byte on the host line, in either direction?
    pub(crate) fn is_host_line_busy(&self) -> bool {
        self.simulation.is_host_line_busy()
    }

    /// Logs the faults that ended by themselves since the last call, and keeps their reports.
    pub fn log_ended_faults(&mut self) {
        let ended = self.simulation.take_ended_faults();
        if ended.is_empty() {
            return;
        }
        let _inside = self.span.enter();
        ended.iter().for_each(|report| info!("fault over: {report}"));
        self.ended_faults.extend(ended);
        let excess = self.ended_faults.len().saturating_sub(ENDED_FAULTS);
        self.ended_faults.drain(..excess);
    }

    /// The last faults that ended by themselves, 16 at most.
    #[must_use]
    pub fn ended_faults(&self) -> &[FaultReport] {
        &self.ended_faults
    }

    /// Keeps a copy of the arm. It replaces a copy of the same name.
    ///
    /// # Errors
    /// The name is empty or too long, or there are too many copies.
    pub fn keep_snapshot(&mut self, name: String) -> Result<(), SnapshotRefusal> {
        let (simulation, ended_faults) = (self.simulation.clone(), self.ended_faults.clone());
        self.snapshots.keep(name, ArmSnapshot { simulation, ended_faults })
    }

    /// Restores the arm to a copy. Returns the virtual time of the copy.
    ///
    /// # Errors
    /// There is no such copy, or its settings cannot be written.
    pub fn restore_snapshot(&mut self, name: &str) -> Result<Instant, SnapshotRefusal> {
        let snapshot = self.snapshots.get(name)?;
        let restored = self.simulation.restore(&snapshot.simulation);
        restored.map_err(|error| SnapshotRefusal::Settings(error.kind()))?;
        self.ended_faults.clone_from(&snapshot.ended_faults);
        Ok(self.simulation.now())
    }

    /// The path of the pseudo-terminal, which clients open.
    #[must_use]
    pub fn port(&self) -> &Path {
        self.pty.path()
    }
}

impl<F: NorFlash + Clone, B: ServoBus, C: ArmController> PtyArm<F, B, C> {
    /// Connects an arm to a pseudo-terminal. Its log lines are in `span`.
    #[must_use]
    pub const fn new(simulation: SimulatedArm<F, B, C>, pty: Pty, span: Span) -> Self {
        Self {
            simulation,
            pty,
            is_blocked: false,
            is_strict: false,
            span,
            ended_faults: Vec::new(),
            snapshots: Snapshots::new(),
        }
    }

    /// Passes bytes only from and to clients that have the arm's baud rate, as on a serial line.
    pub const fn set_strict_baud(&mut self) {
        self.is_strict = true;
    }

    /// Do bytes pass between the client and the arm? Always, unless the baud rate is checked and the client has another rate.
    fn has_clients_rate(&self) -> io::Result<bool> {
        Ok(!self.is_strict || self.pty.baud()? == self.simulation.baud())
    }

    /// Switches the arm off and on.
    pub fn power_cycle(&mut self, now: Instant) {
        let _inside = self.span.enter();
        info!("power cycle");
        self.simulation.power_cycle(now);
    }

    /// Restarts the controller of the arm. The servos keep their power.
    pub fn restart_controller(&mut self, now: Instant) {
        let _inside = self.span.enter();
        info!("restart of the controller");
        self.simulation.restart_controller(now);
    }

    /// Logs that the port failed.
    pub(crate) fn report_failure(&self, failure: &io::Error) {
        let _inside = self.span.enter();
        error!("the port failed ({failure}): this arm ends");
    }

    /// Passes bytes in both directions and simulates the arm up to `now`. Returns when to call again.
    ///
    /// # Errors
    /// The operating system fails: the port or inotify.
    pub fn poll(&mut self, now: Instant, clients: Option<&mut Clients>) -> io::Result<Instant> {
        let _inside = self.span.clone().entered();
        let mut bytes = [0; pace::CAPACITY];
        let room = bytes.get_mut(..self.simulation.host_room()).unwrap_or(&mut []);
        let can_read = !room.is_empty();
        let count = if can_read { self.pty.read(room)? } else { 0 };
        let mut was_emptied = false;
        if let Some(clients) = clients {
            // After the read: the client that sent these bytes has to be counted before its answer is written.
            if count > 0 {
                clients.update()?;
            }
            was_emptied = self.pty.update_clients(clients)?;
        }
        // If the port was without a client for a moment: the bytes are from the next client if there is one now, otherwise from
        // the last client.
        if was_emptied && self.pty.has_client() {
            self.simulation.host_disconnect();
        }
        if count > 0 && self.has_clients_rate()? {
            self.simulation.host_send(now, bytes.get(..count).unwrap_or(&[]));
        }
        if was_emptied && !self.pty.has_client() {
            self.simulation.host_disconnect();
        }
        // A read without bytes means that the host has sent nothing up to now.
        let is_idle = can_read && count == 0;
        self.simulation.advance(now, is_idle);
        while self.deliver()? {
            self.simulation.advance(now, is_idle);
        }
        Ok(self.simulation.deadline(self.pty.has_client()))
    }

    /// Writes the arrived bytes to the client, or drops them if no client can receive them. Returns whether this made room on the
    /// line.
    fn deliver(&mut self) -> io::Result<bool> {
        let mut has_delivered = false;
        self.is_blocked = false;
        while !self.is_blocked && !self.simulation.host_received().is_empty() {
            let bytes = self.simulation.host_received();
            let offered = bytes.len();
            let is_heard = self.pty.has_client() && self.has_clients_rate()?;
            let taken = if is_heard { self.pty.write(bytes)? } else { offered };
            self.simulation.host_take(taken);
            self.is_blocked = taken < offered;
            has_delivered |= taken > 0;
        }
        Ok(has_delivered)
    }

    /// Did a client open the port, or the last client close it, since the last [`PtyArm::poll`]?
    #[must_use]
    pub fn has_news(&self, clients: &Clients) -> bool {
        self.pty.has_news(clients)
    }

    /// The servo bus, for example to pass it the bytes of real servos.
    pub const fn bus(&mut self) -> &mut B {
        self.simulation.bus()
    }

    /// [`PtyArm::interest`] for poll(2).
    #[must_use]
    pub fn poll_interest(&self) -> PollFlags {
        let mut interest = PollFlags::empty();
        interest.set(PollFlags::IN, self.interest().contains(EventFlags::IN));
        interest.set(PollFlags::OUT, self.interest().contains(EventFlags::OUT));
        interest
    }

    /// The events of the port after which [`PtyArm::poll`] has to be called.
    #[must_use]
    pub fn interest(&self) -> EventFlags {
        let mut interest = EventFlags::empty();
        interest.set(EventFlags::IN, self.simulation.host_room() > 0);
        interest.set(EventFlags::OUT, self.is_blocked);
        interest
    }
}

impl<F, B, C> AsFd for PtyArm<F, B, C> {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pty.master()
    }
}
