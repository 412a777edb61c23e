//! The loop that puts worlds behind ports: where clock, file descriptors and signals meet the arms.
//!
//! One thread that sleeps until somebody writes, comes, goes or signals, or until an arm has something due. An arm
//! that has nothing to do costs nothing, however many there are.

use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};

use embedded_storage::nor_flash::NorFlash;
use protocol_core::time::Instant;
use rustix::event::epoll::{self, CreateFlags, Event, EventData, EventFlags};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::arm::Arm;
use crate::clients::Clients;
use crate::clock::{Clock, sleep_until};
use crate::signals::{Signals, Wish};

/// Events taken at a time; the rest come in the next turn.
const EVENTS: usize = 64;
/// No time: for calls that look and do not wait.
const AT_ONCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 0 };
/// What stands for the signals among the numbers of the arms.
const SIGNALS: u64 = u64::MAX;
/// Likewise, for the comings and goings of clients.
const CLIENTS: u64 = u64::MAX - 1;

/// Arms, and what they wait for.
#[derive(Debug)]
pub struct Shell<F> {
    arms: Vec<Arm<F>>,
    /// When each wants its next turn.
    due: Vec<Instant>,
    /// What each is waited for with.
    interests: Vec<EventFlags>,
    /// `None` where the system cannot tell who is there.
    clients: Option<Clients>,
    epoll: OwnedFd,
}

impl<F: NorFlash + Clone> Shell<F> {
    /// A shell round these arms, whose clients are counted in `clients`.
    ///
    /// # Errors
    /// The operating system gives no epoll instance, or not enough room in it.
    pub fn new(arms: Vec<Arm<F>>, clients: Option<Clients>) -> io::Result<Self> {
        let epoll = epoll::create(CreateFlags::CLOEXEC)?;
        for (number, arm) in (0..).zip(&arms) {
            epoll::add(&epoll, arm, EventData::new_u64(number), arm.interest())?;
        }
        if let Some(clients) = &clients {
            epoll::add(&epoll, clients, EventData::new_u64(CLIENTS), EventFlags::IN)?;
        }
        let due = vec![Instant::ZERO; arms.len()];
        let interests = arms.iter().map(Arm::interest).collect();
        Ok(Self { arms, due, interests, clients, epoll })
    }

    /// Runs until a signal says otherwise.
    ///
    /// # Errors
    /// The operating system fails: a port, inotify or epoll.
    pub fn run(mut self, clock: &mut Clock, signals: &mut Signals) -> io::Result<()> {
        epoll::add(&self.epoll, signals.as_fd(), EventData::new_u64(SIGNALS), EventFlags::IN)?;
        loop {
            let mut space = [MaybeUninit::uninit(); EVENTS];
            let events = self.wait(clock, &mut space)?;
            let now = clock.now();
            // Before anything is read: what was sent after a signal must not meet an arm that has not seen it.
            if self.obey(signals, now) {
                return Ok(());
            }
            for event in events {
                match event.data.u64() {
                    SIGNALS => {}
                    CLIENTS => self.clients.as_mut().map_or(Ok(()), Clients::look)?,
                    number => self.turn(usize::try_from(number).unwrap_or(usize::MAX), now)?,
                }
            }
            self.note_clients(now);
            for number in 0..self.arms.len() {
                if self.due.get(number).is_some_and(|&due| due <= now) {
                    self.turn(number, now)?;
                }
            }
        }
    }

    /// Sleeps until something happens or is due. Of the two ways to wait for many ports, one is poor at many, and
    /// the other, before Linux 5.11, at less than a millisecond: so the first waits for the second.
    fn wait<'space>(
        &self,
        clock: &mut Clock,
        space: &'space mut [MaybeUninit<Event>; EVENTS],
    ) -> io::Result<&'space mut [Event]> {
        let earliest = self.due.iter().min().copied().unwrap_or(Instant::FAR_FUTURE);
        let time = sleep_until(clock.now(), earliest);
        let looked = match poll(&mut [PollFd::new(&self.epoll, PollFlags::IN)], Some(&time)) {
            Ok(0) => return Ok(&mut []),
            Ok(_) => epoll::wait(&self.epoll, space, Some(&AT_ONCE)),
            Err(error) => Err(error),
        };
        match looked {
            Ok((events, _)) => Ok(events),
            Err(Errno::INTR) => Ok(&mut []),
            Err(error) => Err(error.into()),
        }
    }

    /// Does what signals ask for. Says whether that is to end.
    fn obey(&mut self, signals: &mut Signals, now: Instant) -> bool {
        for wish in signals.wishes() {
            match wish {
                Wish::End => return true,
                Wish::PowerCycle => {
                    self.arms.iter_mut().for_each(|arm| arm.power_cycle(now));
                    self.due.fill(now);
                }
            }
        }
        false
    }

    /// Arms that clients came to, or left, are due, whoever found it out.
    fn note_clients(&mut self, now: Instant) {
        let Some(clients) = &mut self.clients else { return };
        if clients.take_fresh() {
            let arms = self.due.iter_mut().zip(&self.arms);
            arms.filter(|(_, arm)| arm.has_news(clients)).for_each(|(due, _)| *due = now);
        }
    }

    fn turn(&mut self, number: usize, now: Instant) -> io::Result<()> {
        let (Some(arm), Some(due), Some(interest)) =
            (self.arms.get_mut(number), self.due.get_mut(number), self.interests.get_mut(number))
        else {
            return Ok(());
        };
        *due = arm.turn(now, self.clients.as_mut())?;
        if *interest != arm.interest() {
            *interest = arm.interest();
            let number = u64::try_from(number).unwrap_or(u64::MAX);
            epoll::modify(&self.epoll, &*arm, EventData::new_u64(number), *interest)?;
        }
        Ok(())
    }
}
