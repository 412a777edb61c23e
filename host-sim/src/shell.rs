//! The loop that puts a world behind a port: where clock, file descriptors and signals meet the arm.
//!
//! One thread that sleeps in poll(2) until somebody writes, comes, goes or signals, or until the world has
//! something due.

use std::io;
use std::os::fd::AsFd;

use embedded_storage::nor_flash::NorFlash;
use protocol_core::time::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use tracing::info;

use crate::clock::{Clock, sleep_until};
use crate::pace;
use crate::pty::Pty;
use crate::signals::{Signals, Wish};
use crate::world::World;

/// A world, a port, and whether the port is full.
#[derive(Debug)]
pub struct Shell<F> {
    world: World<F>,
    pty: Pty,
    /// The client does not read, and its buffers in the kernel are full.
    is_blocked: bool,
}

impl<F: NorFlash + Clone> Shell<F> {
    /// Puts `world` behind `pty`.
    #[must_use]
    pub const fn new(world: World<F>, pty: Pty) -> Self {
        Self { world, pty, is_blocked: false }
    }

    /// Runs until a signal says otherwise.
    ///
    /// # Errors
    /// The operating system fails: the port or poll(2).
    pub fn run(mut self, clock: &mut Clock, signals: &mut Signals) -> io::Result<()> {
        loop {
            for wish in signals.wishes() {
                match wish {
                    Wish::End => return Ok(()),
                    Wish::PowerCycle => {
                        info!("power cycle");
                        self.world.power_cycle(clock.now());
                    }
                }
            }
            let now = clock.now();
            self.turn(now)?;
            let deadline = self.world.deadline(self.pty.has_client());
            self.sleep(sleep_until(clock.now(), deadline), signals)?;
        }
    }

    /// One turn: what came in, what is due, what goes out.
    fn turn(&mut self, now: Instant) -> io::Result<()> {
        let mut bytes = [0; pace::CAPACITY];
        let room = bytes.get_mut(..self.world.host_room()).unwrap_or(&mut []);
        let can_read = !room.is_empty();
        let count = if can_read { self.pty.read(room)? } else { 0 };
        // After the read, so that whoever sent these bytes is known by the time their answer goes out.
        if self.pty.look_for_clients()? {
            self.world.host_hangs_up();
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
        Ok(())
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

    fn sleep(&self, time: Timespec, signals: &Signals) -> io::Result<()> {
        let mut port = PollFlags::empty();
        port.set(PollFlags::IN, self.world.host_room() > 0);
        port.set(PollFlags::OUT, self.is_blocked);
        let master = self.pty.master();
        let signals = signals.as_fd();
        let clients = self.pty.comings_and_goings().unwrap_or(signals);
        let mut wanted = [
            PollFd::from_borrowed_fd(master, port),
            PollFd::from_borrowed_fd(signals, PollFlags::IN),
            PollFd::from_borrowed_fd(clients, PollFlags::IN),
        ];
        match poll(&mut wanted, Some(&time)) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}
