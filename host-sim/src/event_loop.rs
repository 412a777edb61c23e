//! The loop that serves arms on pseudo-terminals: clock, file descriptors and signals.
//!
//! One thread sleeps until a port or a control socket has news of its clients, until a signal comes, or until an arm is due. An
//! idle arm needs few wake-ups. An arm whose port fails ends; the others continue.

use std::io;
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};

use arm_sim::controller::ArmController;
use arm_sim::plant::Plant;
use embedded_storage::nor_flash::NorFlash;
use motion_core::Controller;
use protocol_core::time::Instant;
use rustix::event::epoll::{self, CreateFlags, Event, EventData, EventFlags};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::control::execute::execute;
use crate::control::socket::ControlSocket;
use crate::pty_arm::PtyArm;
use crate::signals::{SignalAction, Signals};
use crate::virtual_clock::VirtualClock;
use tty_ports::clients::Clients;

/// The most events per call; the other events follow in the next call.
const EVENTS: usize = 64;
/// The timeout of calls that do not wait.
const NO_WAIT: Timespec = Timespec { tv_sec: 0, tv_nsec: 0 };
/// The event data of the signals. The ports of the arms have the numbers of the arms, from 0.
const SIGNALS: u64 = u64::MAX;
/// The event data of the clients.
const CLIENTS: u64 = u64::MAX - 1;
/// The event data of the control socket of the first arm. The numbers of the other control sockets follow.
const CONTROL: u64 = 1 << 32;

/// The arms of a process, with their ports and control sockets.
#[derive(Debug)]
pub struct EventLoop<F, C = Controller> {
    arms: Vec<ArmEntry<F, C>>,
    /// `None` if the system does not report clients.
    clients: Option<Clients>,
    epoll: OwnedFd,
}

/// An arm, and when to poll it.
#[derive(Debug)]
struct ArmEntry<F, C> {
    arm: PtyArm<F, Plant, C>,
    control: Option<ControlSocket>,
    due: Instant,
    /// The events of its port that epoll reports.
    interest: EventFlags,
    /// Its port failed: the arm is not polled any more.
    has_failed: bool,
}

impl<F: NorFlash + Clone, C: ArmController> EventLoop<F, C> {
    /// A loop for these arms. `clients` reports their clients.
    ///
    /// # Errors
    /// The operating system refuses an epoll instance or an entry in it.
    pub fn new(arms: Vec<PtyArm<F, Plant, C>>, clients: Option<Clients>) -> io::Result<Self> {
        let epoll = epoll::create(CreateFlags::CLOEXEC)?;
        for (number, arm) in (0..).zip(&arms) {
            epoll::add(&epoll, arm, EventData::new_u64(number), arm.interest())?;
        }
        if let Some(clients) = &clients {
            epoll::add(&epoll, clients, EventData::new_u64(CLIENTS), EventFlags::IN)?;
        }
        let entry = |arm: PtyArm<F, Plant, C>| ArmEntry {
            interest: arm.interest(),
            arm,
            control: None,
            due: Instant::ZERO,
            has_failed: false,
        };
        Ok(Self { arms: arms.into_iter().map(entry).collect(), clients, epoll })
    }

    /// Adds the control sockets of the arms, in their order. `None`: the arm has none.
    ///
    /// # Errors
    /// The operating system refuses an entry in epoll.
    pub fn add_controls(&mut self, controls: Vec<Option<ControlSocket>>) -> io::Result<()> {
        for (data, (entry, control)) in (CONTROL..).zip(self.arms.iter_mut().zip(controls)) {
            control.iter().try_for_each(|control| control.register(&self.epoll, EventData::new_u64(data)))?;
            entry.control = control;
        }
        Ok(())
    }

    /// Runs until a signal ends it.
    ///
    /// # Errors
    /// The operating system fails: poll(2), inotify, epoll, accepting a client of a control socket, or the port of the last arm.
    pub fn run(mut self, clock: &mut VirtualClock, signals: &mut Signals) -> io::Result<()> {
        epoll::add(&self.epoll, signals.as_fd(), EventData::new_u64(SIGNALS), EventFlags::IN)?;
        loop {
            let mut space = [MaybeUninit::uninit(); EVENTS];
            let due = self.arms.iter().map(|entry| entry.due).min().unwrap_or(Instant::FAR_FUTURE);
            // Only lockstep uses this value.
            let is_busy = clock.is_in_lockstep() && self.is_host_line_busy();
            let events = self.wait(&clock.sleep(due, is_busy), &mut space)?;
            let now = clock.tick(due, is_busy);
            // Signals come first: bytes that a client sends after a signal must reach the arm after the signal's action.
            if self.apply_signals(signals, now) {
                return Ok(());
            }
            for event in events {
                match event.data.u64() {
                    SIGNALS => {}
                    CLIENTS => self.clients.as_mut().map_or(Ok(()), Clients::update)?,
                    data @ CONTROL.. => self.poll_control(index(data - CONTROL), clock)?,
                    number => self.poll_arm(index(number), clock.now())?,
                }
            }
            // Restoring a snapshot changes the virtual time.
            let now = clock.now();
            self.wake_arms_with_news(now);
            for number in 0..self.arms.len() {
                if self.arms.get(number).is_some_and(|entry| entry.due <= now) {
                    self.poll_arm(number, now)?;
                }
                if self.arms.get(number).is_some_and(|entry| entry.is_control_due(now)) {
                    self.poll_control(number, clock)?;
                }
            }
        }
    }

    fn is_host_line_busy(&self) -> bool {
        self.arms.iter().any(|entry| !entry.has_failed && entry.arm.is_host_line_busy())
    }

    /// Sleeps until an event, at most for this time. poll(2) is slow with many ports, and epoll(7) has no timeouts below a
    /// millisecond before Linux 5.11. So poll(2) waits for the epoll instance.
    fn wait<'space>(
        &self,
        time: &Timespec,
        space: &'space mut [MaybeUninit<Event>; EVENTS],
    ) -> io::Result<&'space mut [Event]> {
        let result = match poll(&mut [PollFd::new(&self.epoll, PollFlags::IN)], Some(time)) {
            Ok(0) => return Ok(&mut []),
            Ok(_) => epoll::wait(&self.epoll, space, Some(&NO_WAIT)),
            Err(error) => Err(error),
        };
        match result {
            Ok((events, _)) => Ok(events),
            Err(Errno::INTR) => Ok(&mut []),
            Err(error) => Err(error.into()),
        }
    }

    /// Executes the actions of signals. Returns whether the loop has to end.
    fn apply_signals(&mut self, signals: &mut Signals, now: Instant) -> bool {
        for action in signals.actions() {
            match action {
                SignalAction::End => return true,
                SignalAction::Unplug => Signals::warn_of_unplug(),
                SignalAction::PowerCycle => self.for_each_arm(now, PtyArm::power_cycle),
                SignalAction::RestartController => self.for_each_arm(now, PtyArm::restart_controller),
            }
        }
        false
    }

    fn for_each_arm(&mut self, now: Instant, action: impl Fn(&mut PtyArm<F, Plant, C>, Instant)) {
        for entry in self.arms.iter_mut().filter(|entry| !entry.has_failed) {
            action(&mut entry.arm, now);
            entry.due = now;
        }
    }

    /// Makes an arm due at once if a client opened its port, or the last client closed it.
    fn wake_arms_with_news(&mut self, now: Instant) {
        let Some(clients) = &mut self.clients else { return };
        if clients.take_has_changed() {
            let arms = self.arms.iter_mut().filter(|entry| !entry.has_failed && entry.arm.has_news(clients));
            arms.for_each(|entry| entry.due = now);
        }
    }

    /// Polls the control socket of an arm. If there was a request, the arm becomes due at once.
    fn poll_control(&mut self, number: usize, clock: &mut VirtualClock) -> io::Result<()> {
        let Some(entry) = self.arms.get_mut(number).filter(|entry| !entry.has_failed) else { return Ok(()) };
        let ArmEntry { arm, control: Some(control), due, .. } = entry else { return Ok(()) };
        let now = clock.now();
        let data = EventData::new_u64(CONTROL + u64::try_from(number).unwrap_or(u64::MAX));
        let execute = |line: &[u8]| {
            arm.simulation_mut().advance(clock.now(), false);
            arm.log_ended_faults();
            execute(arm, clock, line)
        };
        if control.poll(&self.epoll, data, now, execute)? {
            *due = clock.now();
        }
        Ok(())
    }

    /// Polls an arm. If its port fails, the arm ends. Returns an error only if no arm is left.
    fn poll_arm(&mut self, number: usize, now: Instant) -> io::Result<()> {
        let Some(entry) = self.arms.get_mut(number).filter(|entry| !entry.has_failed) else { return Ok(()) };
        let Err(failure) = entry.poll(number, now, self.clients.as_mut(), &self.epoll) else { return Ok(()) };
        entry.fail(&failure, &self.epoll);
        if self.arms.iter().all(|entry| entry.has_failed) { Err(failure) } else { Ok(()) }
    }
}

impl<F: NorFlash + Clone, C: ArmController> ArmEntry<F, C> {
    fn poll(
        &mut self,
        number: usize,
        now: Instant,
        clients: Option<&mut Clients>,
        epoll: &OwnedFd,
    ) -> io::Result<()> {
        self.due = self.arm.poll(now, clients)?;
        self.arm.log_ended_faults();
        if self.interest != self.arm.interest() {
            self.interest = self.arm.interest();
            let number = u64::try_from(number).unwrap_or(u64::MAX);
            epoll::modify(epoll, &self.arm, EventData::new_u64(number), self.interest)?;
        }
        Ok(())
    }

    /// Is an answer due for which a client of the control socket waits?
    fn is_control_due(&self, now: Instant) -> bool {
        self.control.as_ref().and_then(ControlSocket::due).is_some_and(|due| due <= now)
    }

    fn fail(&mut self, failure: &io::Error, epoll: &OwnedFd) {
        self.arm.report_failure(failure);
        self.control = None;
        // This fails if epoll itself has failed.
        let _ = epoll::delete(epoll, &self.arm);
        self.due = Instant::FAR_FUTURE;
        self.has_failed = true;
    }
}

/// The number of an arm in event data.
fn index(data: u64) -> usize {
    usize::try_from(data).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;

    use arm_sim::flash::Flash;
    use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
    use motion_core::TorqueCodes;
    use protocol_core::registers::map::SPEED;
    use protocol_core::request::Request;
    use protocol_core::time::Duration;
    use protocol_core::wire::FrameBuffer;
    use tracing::Span;

    use super::*;
    use tty_ports::pty::Pty;

    fn arm(pty: Pty) -> PtyArm<Flash> {
        let config = ArmConfig { chip_id: [0; 6], is_paced: false, torque_codes: TorqueCodes::default() };
        let plant = Plant::new(Instant::ZERO);
        PtyArm::new(SimulatedArm::new(Instant::ZERO, config, Flash::in_memory(), plant), pty, Span::none())
    }

    #[test]
    fn an_arm_whose_port_fails_ends_and_the_others_continue() {
        let good = Pty::open(None).unwrap();
        let mut client = File::options().write(true).open(good.path()).unwrap();
        let mut event_loop = EventLoop::new(vec![arm(Pty::broken().unwrap()), arm(good)], None).unwrap();
        let now = Instant::ZERO + Duration::from_millis(1_000);
        event_loop.poll_arm(0, now).unwrap();
        assert!(event_loop.arms[0].has_failed);
        let mut frame = FrameBuffer::new();
        Request::Write { address: SPEED.address, values: &[7] }.encode(&mut frame);
        client.write_all(&frame).unwrap();
        for number in [1, 0] {
            event_loop.poll_arm(number, now).unwrap();
        }
        assert_eq!(event_loop.arms[1].arm.register(SPEED.address), 7);
        assert_eq!(event_loop.arms[0].due, Instant::FAR_FUTURE, "it is not polled again");
    }

    #[test]
    fn the_loop_fails_when_the_last_arm_has_failed() {
        let mut event_loop =
            EventLoop::new(vec![arm(Pty::broken().unwrap()), arm(Pty::broken().unwrap())], None).unwrap();
        event_loop.poll_arm(1, Instant::ZERO).unwrap();
        assert!(event_loop.poll_arm(0, Instant::ZERO).is_err());
    }
}
