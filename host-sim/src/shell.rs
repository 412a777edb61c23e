//! The loop that puts worlds behind ports: where clock, file descriptors and signals meet the arms.
//!
//! One thread that sleeps until somebody writes, comes, goes or signals, or until an arm has something due. An arm
//! that has nothing to do costs nothing, however many there are. An arm whose port fails ends, and the others go on.

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
    /// Which have failed.
    has_ended: Vec<bool>,
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
        let has_ended = vec![false; arms.len()];
        Ok(Self { arms, due, interests, has_ended, clients, epoll })
    }

    /// Runs until a signal says otherwise.
    ///
    /// # Errors
    /// The operating system fails: inotify, epoll, or the port of the last arm that was left.
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
                Wish::Unplug => {}
                Wish::PowerCycle => {
                    self.arms.iter_mut().for_each(|arm| arm.power_cycle(now));
                    self.due.fill(now);
                }
                Wish::RestartController => {
                    self.arms.iter_mut().for_each(|arm| arm.restart_controller(now));
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

    /// One turn of an arm. If it fails, it is the arm's last; an error means that no arm is left.
    fn turn(&mut self, number: usize, now: Instant) -> io::Result<()> {
        if self.has_ended.get(number).is_some_and(|&has_ended| has_ended) {
            self.due.get_mut(number).into_iter().for_each(|due| *due = Instant::FAR_FUTURE);
            return Ok(());
        }
        let Err(failure) = self.try_turn(number, now) else { return Ok(()) };
        self.end(number, &failure);
        if self.has_ended.iter().all(|&has_ended| has_ended) { Err(failure) } else { Ok(()) }
    }

    fn end(&mut self, number: usize, failure: &io::Error) {
        if let (Some(arm), Some(due), Some(has_ended)) =
            (self.arms.get(number), self.due.get_mut(number), self.has_ended.get_mut(number))
        {
            arm.report_failure(failure);
            // It may be the very thing that failed.
            let _ = epoll::delete(&self.epoll, arm);
            *due = Instant::FAR_FUTURE;
            *has_ended = true;
        }
    }

    fn try_turn(&mut self, number: usize, now: Instant) -> io::Result<()> {
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

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;

    use motion_core::TorqueCodes;
    use protocol_core::registers::map::SPEED;
    use protocol_core::request::Request;
    use protocol_core::time::Duration;
    use protocol_core::wire::FrameBuffer;
    use tracing::Span;

    use super::*;
    use crate::pty::Pty;
    use arm_sim::flash::Flash;
    use arm_sim::plant::Plant;
    use arm_sim::world::{Setup, World};

    fn arm(pty: Pty) -> Arm<Flash> {
        let setup = Setup { chip_id: [0; 6], is_paced: false, torque_codes: TorqueCodes::default() };
        let world = World::new(Instant::ZERO, setup, Flash::in_memory(), Plant::new(Instant::ZERO));
        Arm::new(world, pty, Span::none())
    }

    #[test]
    fn an_arm_whose_port_fails_ends_and_the_others_go_on() {
        let good = Pty::open(None).unwrap();
        let mut client = File::options().write(true).open(good.path()).unwrap();
        let mut shell = Shell::new(vec![arm(Pty::broken()), arm(good)], None).unwrap();
        let now = Instant::ZERO + Duration::from_millis(1_000);
        shell.turn(0, now).unwrap();
        assert_eq!((shell.has_ended[0], shell.due[0]), (true, Instant::FAR_FUTURE));
        let mut frame = FrameBuffer::new();
        Request::Write { address: SPEED.address, values: &[7] }.encode(&mut frame);
        client.write_all(&frame).unwrap();
        for number in [1, 0] {
            shell.due[number] = now;
            shell.turn(number, now).unwrap();
        }
        assert_eq!(shell.arms[1].registers().get(SPEED.address), 7);
        assert_eq!(shell.due[0], Instant::FAR_FUTURE, "it is not asked for again");
    }

    #[test]
    fn when_the_last_arm_has_failed_so_has_the_shell() {
        let mut shell = Shell::new(vec![arm(Pty::broken()), arm(Pty::broken())], None).unwrap();
        shell.turn(1, Instant::ZERO).unwrap();
        assert!(shell.turn(0, Instant::ZERO).is_err());
    }
}
