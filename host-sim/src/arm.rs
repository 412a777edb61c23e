//! One arm behind its port: what came in, what is due, what goes out. Knows no other arm, and not who wakes it up.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};

use embedded_storage::nor_flash::NorFlash;
use protocol_core::time::Instant;
use rustix::event::PollFlags;
use rustix::event::epoll::EventFlags;
use tracing::{Span, error, info};

use crate::clients::Clients;
use crate::pty::Pty;
use arm_sim::pace;
use arm_sim::plant::Plant;
use arm_sim::servo_bus::ServoBus;
use arm_sim::world::World;

/// A world, a port, and whether the port is full.
#[derive(Debug)]
pub struct Arm<F, B = Plant> {
    world: World<F, B>,
    pty: Pty,
    /// The client does not read, and its buffers in the kernel are full.
    is_blocked: bool,
    /// What it says is said inside of this.
    span: Span,
}

impl<F: NorFlash + Clone, B: ServoBus> Arm<F, B> {
    /// Puts `world` behind `pty`; what is logged about it is logged inside of `span`.
    #[must_use]
    pub const fn new(world: World<F, B>, pty: Pty, span: Span) -> Self {
        Self { world, pty, is_blocked: false, span }
    }

    /// Switches it off and on.
    pub fn power_cycle(&mut self, now: Instant) {
        let _inside = self.span.enter();
        info!("power cycle");
        self.world.power_cycle(now);
    }

    /// Says that its port failed.
    pub(crate) fn report_failure(&self, failure: &io::Error) {
        let _inside = self.span.enter();
        error!("the port failed ({failure}): this arm ends");
    }

    /// The registers, to look at.
    #[cfg(test)]
    pub(crate) fn registers(&self) -> &protocol_core::registers::RegisterFile {
        self.world.registers()
    }

    /// Restarts its controller, and leaves its servos alone.
    pub fn restart_controller(&mut self, now: Instant) {
        let _inside = self.span.enter();
        info!("restart of the controller");
        self.world.restart_controller(now);
    }

    /// One turn at `now`. Says when it wants the next.
    ///
    /// # Errors
    /// The operating system fails: the port or inotify.
    pub fn turn(&mut self, now: Instant, clients: Option<&mut Clients>) -> io::Result<Instant> {
        let _inside = self.span.clone().entered();
        let mut bytes = [0; pace::CAPACITY];
        let room = bytes.get_mut(..self.world.host_room()).unwrap_or(&mut []);
        let can_read = !room.is_empty();
        let count = if can_read { self.pty.read(room)? } else { 0 };
        if let Some(clients) = clients {
            // After the read, so that whoever sent these bytes is known by the time their answer goes out.
            if count > 0 {
                clients.look()?;
            }
            if self.pty.take_note_of(clients)? {
                self.world.host_hangs_up();
            }
        }
        if count > 0 {
            self.world.host_sends(now, bytes.get(..count).unwrap_or(&[]));
        }
        // Nothing waited after `now`, so nothing did at any time before.
        let is_silent = can_read && count == 0;
        self.world.advance(now, is_silent);
        while self.deliver()? {
            self.world.advance(now, is_silent);
        }
        Ok(self.world.deadline(self.pty.has_client()))
    }

    /// Hands what is through to the client, or to nobody. Says whether the link has more room now.
    fn deliver(&mut self) -> io::Result<bool> {
        let mut delivered = false;
        self.is_blocked = false;
        while !self.is_blocked && !self.world.host_hears().is_empty() {
            let bytes = self.world.host_hears();
            let offered = bytes.len();
            let taken = if self.pty.has_client() { self.pty.write(bytes)? } else { offered };
            self.world.host_heard(taken);
            self.is_blocked = taken < offered;
            delivered |= taken > 0;
        }
        Ok(delivered)
    }

    /// Did clients come or go that it took no note of yet?
    #[must_use]
    pub fn has_news(&self, clients: &Clients) -> bool {
        self.pty.has_news(clients)
    }

    /// The servo bus, for whoever moves its bytes.
    pub const fn bus(&mut self) -> &mut B {
        self.world.bus()
    }

    /// A register, to look at.
    #[must_use]
    pub fn register(&self, address: u8) -> u8 {
        self.world.registers().get(address)
    }

    /// Likewise [`Arm::interest`], for poll(2).
    #[must_use]
    pub fn poll_interest(&self) -> PollFlags {
        let mut interest = PollFlags::empty();
        interest.set(PollFlags::IN, self.interest().contains(EventFlags::IN));
        interest.set(PollFlags::OUT, self.interest().contains(EventFlags::OUT));
        interest
    }

    /// What has to happen at the port for it to want a turn before that.
    #[must_use]
    pub fn interest(&self) -> EventFlags {
        let mut interest = EventFlags::empty();
        interest.set(EventFlags::IN, self.world.host_room() > 0);
        interest.set(EventFlags::OUT, self.is_blocked);
        interest
    }
}

impl<F, B> AsFd for Arm<F, B> {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.pty.master()
    }
}
